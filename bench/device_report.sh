#!/usr/bin/env bash
# Whether every algorithm keeps the contract on the device that there is, and how long it takes: device_report.sh [-o DIR]
# [--target PLATFORM] [options of tessera bench...]. Runs in a build, and in the archive that scripts/portable.sh makes. Writes
# DIR/report.txt, DIR/report.json and DIR/bench/, the page (without -o: device-report); exit code 1 when a test fails.
set -uo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
out=device-report target=
options=()
while (($#)); do
  case $1 in
    -h | --help) sed -n '2,4s/^# //p' "${BASH_SOURCE[0]}"; exit ;;
    -o) out=$2; shift 2 ;;
    --target) target=$2; shift 2 ;;
    *) options+=("$1"); shift ;;
  esac
done
mkdir -p "$out" || exit 1

if [[ -d $here/bin ]]; then
  program() { echo "$here/bin/$1"; }
  # What this machine has itself comes first: its driver may need a newer one.
  libraries=$here/lib
  for name in libstdc++.so.6 libgcc_s.so.1 libEGL.so.1 libGLdispatch.so.0; do
    ldconfig -p 2>/dev/null | grep -q "$name" || libraries+=:$here/lib/own/$name
  done
  export LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
else
  build=$here/../build/release
  program() {
    case $1 in
      tessera) echo "$build/apps/tessera/tessera" ;;
      *) echo "$build/tests/$1" ;;
    esac
  }
fi

report=$out/report.txt
"$(program tessera)" info --gl >"$report" 2>&1 || { cat "$report"; exit 1; }
cat "$report"
failed=0 suites=
# Tests of the algorithms on OpenGL; where a platform is wanted, those of it alone.
declare -A platforms=([egl-surfaceless]=EglSurfaceless [egl-device]=EglDevice [osmesa]=Osmesa)
for suite in contract_test contract_random_test hard_cases_test raster_{generator,records,run}_test; do
  filter='*Slicing*:*Hybrid*:*Compute*'
  [[ $suite == raster_* ]] && filter='*'
  [[ -n $target && $suite == contract_* ]] && filter="*${platforms[$target]:?no such platform}*"
  started=$SECONDS
  "$(program $suite)" --gtest_filter="$filter" --gtest_brief=1 >"$out/$suite.txt" 2>&1 && state=passed || state=failed
  count=$(sed -n 's/^\[==========\] \([0-9]*\) tests* .*/\1/p' "$out/$suite.txt" | tail -1)
  skipped=$(sed -n 's/^\[  SKIPPED \] \([0-9]*\) tests*.*/\1/p' "$out/$suite.txt" | tail -1)
  [[ $state == passed ]] || failed=1
  printf '%-22s %s: %s tests, %s skipped, %d s\n' "$suite" "$state" "${count:-no}" "${skipped:-0}" $((SECONDS - started)) |
    tee -a "$report"
  suites+="${suites:+, }{\"suite\": \"$suite\", \"state\": \"$state\", \"tests\": ${count:-0}, \"skipped\": ${skipped:-0}}"
done
[[ -n $target ]] && options+=(--gl "$target")
"$(program tessera)" bench graded:1M -o "$out/bench" --points 64,128,256,512 "${options[@]}" 2>&1 | tee -a "$report"
((PIPESTATUS[0] == 0)) || failed=1
{
  printf '{"suites": [%s],\n"bench": ' "$suites"
  cat "$out/bench/report.json" 2>/dev/null || echo null
  echo '}'
} >"$out/report.json"
echo "$report, $out/report.json"
exit $failed
