"""From run files and folders to what `analysis.campaign` takes."""
