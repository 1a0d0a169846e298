"""Uploads: admission, reception of the form and of the file in it. Read `uploaded_file` first."""
