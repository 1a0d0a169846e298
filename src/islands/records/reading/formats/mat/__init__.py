"""MATLAB files of versions 4, 5 to 7, and 7.3. Read `file` first."""
