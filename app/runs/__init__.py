"""Run files: format, writer, reader, library, importers. The only folder that may import h5py."""
