"""Export of a model as a co-simulation FMU (Functional Mock-up Unit) of FMI 2.0 or 3.0.

`archive` writes the file, `description` the XML; the C files are the interface, around the functions of
`islands.models.block`.
"""
