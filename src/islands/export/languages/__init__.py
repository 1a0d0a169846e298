"""Programs and blocks of models in Python, C, MATLAB, Simulink and Modelica."""
