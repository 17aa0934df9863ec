tessera_test(base_test FOLDER base LINK base)
tessera_test(base_run_progress_test FOLDER base LINK base)
