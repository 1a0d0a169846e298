"""Machine code of programs: generated, compiled for this processor, and stored."""
