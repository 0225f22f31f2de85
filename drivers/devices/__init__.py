"""The device folders: one package a device, independent of each other."""
