"""Files and devices: read strictly, written whole, errors that name file and field.

What the contents mean for tracking is not known here. Begin with `yaml_file` and `csv_file`, by which the others read;
`recording_yaml` names all files of a recording.
"""
