"""Files in, files out: the only room of the core that opens one."""
