"""Puts this folder on the path of imports, for `synthetic`, in the folders below too."""
