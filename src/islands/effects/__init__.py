"""Effects: physics that a simulation may lack, one file per family. Read `interface.effect` first."""
