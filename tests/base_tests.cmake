tessera_test(base_test LINK base)
tessera_test(base_run_progress_test LINK base)
