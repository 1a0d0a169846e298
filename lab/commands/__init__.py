"""Commands of the laboratory, which `islands.cli.app` lists."""
