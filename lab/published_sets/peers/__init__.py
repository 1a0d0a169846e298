"""Other packages for the identification of systems on the published sets. Read `catalogue` first.

Each is installed from the package index into its own virtual environment, and runs in a child process on the
same data and by the same rule as the searches of this package. None of them is a dependency.
"""
