#!/bin/bash
# `gestalt` as the blocks call it: what runs until it is stopped goes on beside them, once it has said that it runs, and finds
# nobody but the robots of this test.
case "$1" in
  peer | center | stream | teach | watch | doctor) set -- "$@" --cfg links.scouting.interface:lo --cfg "links.scouting.address:239.255.77.79:$SCOUTING" ;;
esac
# Clients know a robot by the port that stands in a block; here it is one of this test alone.
case "$1" in
  peer) set -- "${@/#tcp\/127.0.0.1:7447/tcp/127.0.0.1:$SCOUTING}" ;;
  center) set -- "$@" --listen "tcp/127.0.0.1:$SCOUTING" ;;
esac
case "$1" in
  peer | center | stream)
    log="$STAGE/log.$$"
    "$GESTALT" "$@" >"$log" 2>&1 &
    robot=$!
    echo $robot >>"$STAGE/robots"
    for _ in {1..300}; do
      # As long as it takes to turn to another terminal.
      [[ -s $log ]] && sleep 3 && kill -0 $robot 2>/dev/null && exit 0
      kill -0 $robot 2>/dev/null || break
      sleep 0.1
    done
    cat "$log" >&2
    exit 1
    ;;
  watch)
    # Stopped by Ctrl-C, as a person would.
    timeout --signal INT 3 "$GESTALT" "$@"
    status=$?
    [[ $status == 124 ]] || exit $status
    ;;
  *) exec "$GESTALT" "$@" ;;
esac
