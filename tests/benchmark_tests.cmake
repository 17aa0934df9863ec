tessera_test(benchmark_page_test FOLDER benchmark LINK benchmark)
