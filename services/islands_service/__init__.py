"""Job service: queue, store and Ray runtime. Read `domain.job` first, then `coordinator.main_loop`."""
