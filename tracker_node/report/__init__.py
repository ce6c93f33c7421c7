"""Documents for people: tables, charts, pages, PDF, metrics files, progress on the terminal.

What is measured is not known here; `evaluation`, `calibration` and `doctor` fill the documents. Begin with `document`, then
`html` and `pdf`; `metrics_file` is the format of every program that measures.
"""
