# Shared by .ci/metadrive, .ci/safebench and .ci/world, which source it: an experiment set from its cassettes, its roots and tables
# against golden/$set. They name `set`, its files `singles`, those of the tables `common`
# (one an ego; there may be none) and of `stricter` ones, the one of the short form `short`, and its `tables`.
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
  sheets "$1" "$2" "" $common
  [ -z "${stricter:-}" ] || sheets "$1" "$2" preventable- $stricter
}

sheets() { # run folders' parent, target folder, how files begin, experiments
  local from=$1 to=$2 begin=$3 runs table one
  shift 3
  runs=()
  for one in "$@"; do runs+=(--run "$(echo "$from/$set-$one"-????????)"); done
  for table in $tables; do
    "$bin" table "$table" "${runs[@]}" > "$to/$begin$table.md"
    "$bin" table "$table" "${runs[@]}" --format csv > "$to/$begin$table.csv"
    "$bin" table "$table" "${runs[@]}" --format latex --columns all > "$to/$begin$table.tex"
  done
}

# One file; every file, the common ones with 2 and 8 threads and from cached rollouts, and the tables; or new goldens, with --runs from
# finished runs below a folder.
check_set() { # option, --runs, folder
  local one file folder=$scratch/all
  [ "${2:-}" != --runs ] || folder=$3
  case $1 in
    "") check "$short" 2 one ;;
    --full)
      for one in $singles; do check "$one" 2 single; done
      for one in $common ${stricter:-}; do check "$one" 2 all; check "$one" 2 all; done
      write_tables "$scratch/all" "$scratch"
      for file in $(ls "$golden" | grep -E '\.(md|csv|tex)$'); do
        diff -u "$golden/$file" "$scratch/$file"
      done
      for one in $common; do check "$one" 8 eight; done
      ;;
    --bless)
      { echo "# Roots of experiments/$set; made by .ci/$set --bless, checked by .ci/$set."
        for one in $singles $common ${stricter:-}; do
          if [ "${2:-}" = --runs ]; then
            # The last event seals the run; its hash is the root.
            echo "\"$one\" = \"$(tail -n 1 "$folder/$set-$one"-????????/transcript.jsonl | sed -n 's/.*"hash":"\([0-9a-f]*\)".*/\1/p')\""
          else
            echo "\"$one\" = \"$(run "$one" 2 all)\""
          fi
        done
      } > "$scratch/roots.toml"
      mkdir -p "$golden"
      cp "$scratch/roots.toml" "$golden/roots.toml"
      write_tables "$folder" "$golden"
      git --no-pager diff --stat -- golden
      ;;
    *) echo "expected nothing, --full or --bless, found $1" >&2; exit 2 ;;
  esac
}
