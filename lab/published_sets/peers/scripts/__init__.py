"""Scripts of the peers. Child processes run them as files; only the environment of a peer can import one."""
