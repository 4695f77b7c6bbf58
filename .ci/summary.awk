# Passes on what the test runners print, and ends with their sum and with what was skipped, and why. A test binary of the
# built-in harness and one with a table of trials both end with a line "test result: ok. 3 passed; 0 failed; 1 ignored; …".
{ print; fflush() }
/^test result:/ { passed += $4; failed += $6; skipped += $8 }
/^skipped: / { skips[++n] = $0 }
/^(error: |stuck: )/ { broken[++b] = $0 }
END {
  print ""
  for (i = 1; i <= n; i++) print skips[i]
  for (i = 1; i <= b; i++) print broken[i]
  printf "%d passed, %d failed, %d skipped\n", passed, failed, skipped
}
