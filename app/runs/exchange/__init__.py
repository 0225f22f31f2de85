"""Foreign records in and exports out: CSV, JSON, MATLAB, Excel, Parquet, UFF 58, LaTeX."""
