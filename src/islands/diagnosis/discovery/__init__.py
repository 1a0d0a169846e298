"""Discovery of terms that the equations of a simulation lack. Read `term_search` first."""
