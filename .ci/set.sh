# Shared by .ci/metadrive, .ci/safebench and .ci/world, which source it: an experiment set from its cassettes, its roots and tables
# against golden/$set. They name `set`, its files `singles`, those of the tables `common`
# (one an ego), the one of the short form `short`, and its `tables`.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
bin=$PWD/target/release/evodrive
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
golden=golden/$set

run() { # experiment, threads, folder -> root
  "$bin" run "experiments/$set/$1.toml" --jobs "$2" --out "$scratch/$3" --no-report 2>"$scratch/stderr" \
    | sed -n '$s/^root: //p' || { cat "$scratch/stderr" >&2; echo "$1 failed" >&2; exit 1; }
}

check() { # experiment, threads, folder
  local wanted got
  [ -f "$golden/roots.toml" ] || { echo "$golden/roots.toml is missing; make it with .ci/$set --bless" >&2; exit 1; }
  wanted=$(sed -n "s/^\"$1\" = \"\([0-9a-f]*\)\"$/\1/p" "$golden/roots.toml")
  got=$(run "$1" "$2" "$3")
  if [ -z "$wanted" ] || [ "$got" != "$wanted" ]; then
    echo "$1 with $2 threads: root $got, golden $wanted; if this is meant, run .ci/$set --bless and say why" >&2; exit 1
  fi
  echo "$1, $2 threads: $got"
}

recorded() { # experiment, folder -> root: answers made anew by the scripted model, which is a function of the prompts
  # A copy beside the other files, so that the cassette that is recorded is no part of the checkout.
  local copy=experiments/$set/.$1.recorded.toml
  sed "s|cassettes/$set/$1.jsonl.zst|target/$set/$1.jsonl.zst|" "experiments/$set/$1.toml" > "$copy"
  mkdir -p "target/$set"
  "$bin" record "$copy" --overwrite --jobs 2 --out "$scratch/$2" --no-report 2>"$scratch/stderr" \
    | sed -n '$s/^root: //p' || { rm -f "$copy"; cat "$scratch/stderr" >&2; echo "$1 failed" >&2; exit 1; }
  rm -f "$copy"
}

write_tables() { # run folders' parent, target folder
  local runs table one
  runs=()
  for one in $common; do runs+=(--run "$(echo "$1/$set-$one"-*)"); done
  for table in $tables; do
    "$bin" table "$table" "${runs[@]}" > "$2/$table.md"
    "$bin" table "$table" "${runs[@]}" --format csv > "$2/$table.csv"
    "$bin" table "$table" "${runs[@]}" --format latex --columns all > "$2/$table.tex"
  done
}

# One file; every file, the common one with 2 and 8 threads and from cached rollouts, and the tables; or new goldens.
check_set() { # option
  local one file
  case $1 in
    "") check "$short" 2 one ;;
    --full)
      for one in $singles; do check "$one" 2 single; done
      for one in $common; do check "$one" 2 all; check "$one" 2 all; done
      write_tables "$scratch/all" "$scratch"
      for file in "$golden"/*.md "$golden"/*.csv "$golden"/*.tex; do
        diff -u "$file" "$scratch/$(basename "$file")"
      done
      for one in $common; do check "$one" 8 eight; done
      ;;
    --bless)
      { echo "# Roots of experiments/$set; made by .ci/$set --bless, checked by .ci/$set."
        for one in $singles; do echo "\"$one\" = \"$(run "$one" 2 single)\""; done
        for one in $common; do echo "\"$one\" = \"$(run "$one" 2 all)\""; done
      } > "$scratch/roots.toml"
      mkdir -p "$golden"
      cp "$scratch/roots.toml" "$golden/roots.toml"
      write_tables "$scratch/all" "$golden"
      git --no-pager diff --stat -- golden
      ;;
    *) echo "expected nothing, --full or --bless, found $1" >&2; exit 2 ;;
  esac
}
