#!/usr/bin/env bash
# Builds and runs the fuzz targets: scripts/fuzz.sh [seconds for each (30)] [target...]. Targets are the programs of tests/fuzz; all when none is
# named. New inputs are collected in build/fuzz/corpus/TARGET, beside the seeds of tests/fuzz/corpus/TARGET. Fails when one of them ends
# badly, takes longer than 10 s, or asks for too much memory; the input is then in build/fuzz/findings and its name is printed.
# Again with one input: build/fuzz/tests/fuzz/TARGET FILE.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

seconds=${1:-30}
shift || true
targets=("$@")
if [[ ${#targets[@]} -eq 0 ]]; then
  for source in tests/fuzz/fuzz_*.cpp; do targets+=("$(basename "$source" .cpp)"); done
fi

scripts/build.sh fuzz "${targets[@]}"
findings=build/fuzz/findings
mkdir -p "$findings" build/fuzz/logs
export ASAN_OPTIONS=quarantine_size_mb=16:detect_leaks=1:allocator_may_return_null=0
export UBSAN_OPTIONS=print_stacktrace=1

# Every processor has one to run.
for target in "${targets[@]}"; do
  corpus=build/fuzz/corpus/$target
  mkdir -p "$corpus"
  options=(-max_total_time="$seconds" -max_len=16384 -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=64 -print_final_stats=1
    -artifact_prefix="$findings/$target-")
  [[ -f tests/fuzz/$target.dict ]] && options+=(-dict="tests/fuzz/$target.dict")
  while (($(jobs -rp | wc -l) >= $(nproc))); do wait -n || true; done
  {
    status=0
    "build/fuzz/tests/fuzz/$target" "${options[@]}" "$corpus" "tests/fuzz/corpus/$target" >"build/fuzz/logs/$target.log" 2>&1 || status=$?
    echo "$status" >"build/fuzz/logs/$target.status"
  } &
done
wait

failed=()
printf '%-22s %12s %10s %10s %9s %10s\n' target executions coverage features corpus "peak MiB"
for target in "${targets[@]}"; do
  log=build/fuzz/logs/$target.log
  status=$(<"build/fuzz/logs/$target.status")
  # The last line of progress: "#4242 DONE cov: 123 ft: 456 corp: 78/9Kb ..."
  progress=$(grep -E '^#[0-9]+.* cov: ' "$log" | tail -n 1 || true)
  word() { sed -nE "s/.*$1 ([^ ]+).*/\1/p" <<<"$2"; }
  printf '%-22s %12s %10s %10s %9s %10s\n' "$target" "$(word 'stat::number_of_executed_units:' "$(grep 'stat::number' "$log" || true)")" \
    "$(word cov: "$progress")" "$(word ft: "$progress")" "$(word corp: "$progress")" "$(word 'stat::peak_rss_mb: *' "$(grep peak_rss "$log" || true)")"
  if [[ $status -ne 0 ]]; then
    failed+=("$target")
    grep -E '^(==[0-9]+== ?ERROR|SUMMARY|terminate|  what|.*runtime error)' "$log" | head -n 5 || true
    sed -nE 's/.*Test unit written to (.*)/  the input: \1/p' "$log"
    echo "  the log: $log"
  fi
done
if [[ ${#failed[@]} -gt 0 ]]; then
  echo "fuzz: failed: ${failed[*]}" >&2
  exit 1
fi
echo "fuzz: nothing found"
