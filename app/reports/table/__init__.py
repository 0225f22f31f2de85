"""The campaign's table as text, CSV, JSON, Markdown, LaTeX and XLSX."""
