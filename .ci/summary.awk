# The sum of what the test runners printed, what was skipped, and why, and what passed only alone. A test binary of the
# built-in harness and one with a table of trials both end with a line "test result: ok. 3 passed; 0 failed; 1 ignored; …".
/^test result:/ { passed += $4; failed += $6; skipped += $8 }
/^skipped: / { skips[++n] = $0 }
/^flaky: / { flaky[++f] = $0 }
/^(error: |stuck: |failed: |test .* FAILED$)/ { broken[++b] = $0 }
END {
  print ""
  for (i = 1; i <= n; i++) print skips[i]
  for (i = 1; i <= b; i++) print broken[i]
  for (i = 1; i <= f; i++) print flaky[i]
  printf "%d passed%s, %d failed, %d skipped\n", passed, f ? sprintf(" (%d of them flaky)", f) : "", failed, skipped
}
