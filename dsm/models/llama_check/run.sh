#!/bin/bash
# Checks the protocol against a real llama.cpp server with a real small model, outside the default tests:
#
#   dsm/models/llama_check/run.sh [PORT]
#
# 1. every use in words, many questions at once, questions given up (the example `protocol`);
# 2. an episode whose server is killed after its first answer and started again: the episode must succeed, with the
#    embedded backend speaking while the server is away.
# DSM_PROTOCOL and DSM_PROGRAM name programs that are built already (the example, and dsm with the feature models).
# The first time it fetches and builds the server (fetch.sh). docs/models.md has a result. Exit code 1: not as promised.
set -euo pipefail
port=${1:-8741}
here=$(cd -- "$(dirname -- "$0")" && pwd)
root=$(cd -- "$here/../../.." && pwd)
folder=$("$here/fetch.sh")
scratch=$(mktemp -d)
server=
stop() {
  if [ -n "$server" ]; then
    kill -9 "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
    server=
  fi
}
trap 'stop; rm -rf "$scratch"' EXIT

# Waits until a command succeeds; fails after so many turns of a fifth of a second.
until_done() {
  local turns=$1
  shift
  for ((turn = 0; turn < turns; turn++)); do
    "$@" && return 0
    sleep 0.2
  done
  echo "run.sh: in vain: $*" >&2
  return 1
}

is_ready() {
  python3 -c "
import sys, urllib.request
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
sys.exit(opener.open('http://127.0.0.1:$port/health', timeout=2).status != 200)" 2>/dev/null
}

start() {
  "$folder/llama-server" -m "$folder/model.gguf" --host 127.0.0.1 --port "$port" --ctx-size 16384 --parallel 4 \
    --threads "${DSM_THREADS:-2}" >>"$scratch/server.log" 2>&1 &
  server=$!
  until_done 600 is_ready
}

config() {
  cat <<TOML
version = 1
[language]
url = "http://127.0.0.1:$port/v1"
model = "gemma-3-270m"
vision = false
uses = ["parse", "score", "labels"]
max_tokens = 512
max_concurrent = 2
timeout_s = 120.0
total_timeout_s = 240.0
record = "record.jsonl"
$1
TOML
}

cd "$root"
start
echo "server: $("$folder/llama-server" --version 2>&1 | head -n 1)"
config "" >"$scratch/models.toml"
if [ -n "${DSM_PROTOCOL:-}" ]; then
  "$DSM_PROTOCOL" "$scratch/models.toml" 2
else
  cargo run --locked --release --quiet -p dsm-models --example protocol -- "$scratch/models.toml" 2
fi

# An episode of several commands, each with words to read. The server is away between two answers.
rm -f "$scratch/record.jsonl"
config $'connect_timeout_s = 1.0\nretries = 1\naway_after = 1\naway_s = 1.0' >"$scratch/models.toml"
episode=$here/episode.toml
program=${DSM_PROGRAM:-${CARGO_TARGET_DIR:-target}/release/dsm}
[ -n "${DSM_PROGRAM:-}" ] || cargo build --locked --release --quiet --features models
"$program" run "$episode" --backend "$scratch/models.toml" --out "$scratch/out" --json >"$scratch/summary.json" \
  2>"$scratch/run.log" &
run=$!
has() { grep -q "$1" "$scratch/record.jsonl" 2>/dev/null; }
is_over() { ! kill -0 "$run" 2>/dev/null; }
heard_or_over() { has "$1" || is_over; }
until_done 3000 heard_or_over '"requests":1'
is_over && { echo "run.sh: the episode ended before the server was killed" >&2; exit 1; }
stop
echo "killed after $(wc -l <"$scratch/record.jsonl") questions"
until_done 3000 heard_or_over '"error_kind":"\(unreachable\|away\|broken\)"'
before=$(wc -l <"$scratch/record.jsonl")
start
echo "started again after $before questions"
if wait "$run"; then result=0; else result=$?; fi
python3 - "$scratch/record.jsonl" "$scratch/summary.json" "$before" <<'PYTHON'
import collections, json, sys
record = [json.loads(line) for line in open(sys.argv[1])]
summary = json.load(open(sys.argv[2]))
before = int(sys.argv[3])
def endings(events):
    return dict(collections.Counter(event.get("error_kind", event["ending"]) for event in events))
print("up to the restart:", endings(record[:before]))
print("after it:", endings(record[before:]))
for step in summary["steps"]:
    grounding = step.get("grounding") or {}
    spoken = [f"{s['stage']}: {s['backend']}" for s in grounding.get("spoken", [])]
    print(f"{step['command']}: {step['outcome']}; {', '.join(spoken)}")
away = [event for event in record if event.get("error_kind") in ("unreachable", "away", "broken")]
back = [event for event in record[before:] if event.get("error_kind") not in ("unreachable", "away", "broken")]
if not summary["success"] or not away or not back:
    print("not as promised: success", summary["success"], "away", len(away), "back", len(back))
    sys.exit(1)
print("the episode succeeded")
PYTHON
exit "$result"
