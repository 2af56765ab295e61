//! An example at the end of every command's help. `experiments/quickstart.toml` and what it leaves are in every clone.

use clap::Command;

/// Path of a command -> what may be typed from a clone's folder. `runs/RUN` stands for a run folder.
const EXAMPLES: &[(&str, &str)] = &[
    ("init", "evodrive init mine --scenes my.pool"),
    ("plan", "evodrive plan experiments/quickstart.toml"),
    ("run", "evodrive run experiments/quickstart.toml"),
    ("resume", "evodrive resume"),
    ("check", "evodrive check"),
    ("verify", "evodrive verify --jobs 4"),
    ("record", "evodrive record experiments/quickstart.toml --cassette mine.jsonl --set budget.slots=8"),
    ("exchange status", "evodrive exchange status"),
    ("ask", "evodrive ask runs/mine-1/exchange/agent/7.request.md draft.json"),
    ("scenes import", "evodrive scenes import my_scenarios/ --out my.pool"),
    ("scenes generate", "evodrive scenes generate experiments/quickstart.toml --out my.pool"),
    ("scenes list", "evodrive scenes list my.pool --tag junction"),
    ("scenes check", "evodrive scenes check my.pool"),
    ("scenes filter", "evodrive scenes filter my.pool --where is_junction --usable --out busy.pool"),
    ("scenes merge", "evodrive scenes merge one.pool other.pool --out my.pool"),
    ("scenes split", "evodrive scenes split my.pool --held-out 10 --seed 1 --out open.pool --held-out-to closed.pool"),
    ("scenes show", "evodrive scenes show --attempt cat-idm/e0s3 --scene synth/merge/7/13 --html rollout.html"),
    ("scenes best", "evodrive scenes best --top 5 --by severity"),
    ("scenes browse", "evodrive scenes browse my.pool --html browse.html"),
    ("scenes draw", "evodrive scenes draw --attempt cat-idm/e0s3 --scene synth/merge/7/13 --out strip.svg"),
    ("scenes export", "evodrive scenes export my.pool --format scenarionet --out exported"),
    ("scenes compare", "evodrive scenes compare recorded.pool generated.pool"),
    ("scenes stats", "evodrive scenes stats my.pool"),
    ("calibrate", "evodrive calibrate my.pool --out calibration.toml"),
    ("lineage", "evodrive lineage cat-idm"),
    ("show", "evodrive show cat-idm/e1s0"),
    ("program new", "evodrive program new --family cat --out my_program.toml"),
    ("program import", "evodrive program import scenario_type/human.json --out human.toml"),
    ("program edit", "evodrive program edit my_program.toml"),
    ("program set", "evodrive program set my_program.toml /parameters/duration_s 3.5"),
    ("program check", "evodrive program check my_program.toml --scenes my.pool"),
    ("program diff", "evodrive program diff runs/RUN:cat-idm/parent my_program.toml"),
    ("program show", "evodrive program show runs/RUN cat-idm/parent"),
    ("program export", "evodrive program export runs/RUN cat-idm/parent --out my_program.json"),
    ("apply", "evodrive apply my_program.json --scenes my.pool --ego idm"),
    ("suite freeze", "evodrive suite freeze --program my_program.json --scenes my.pool --out my.suite"),
    ("suite show", "evodrive suite show golden/suite/starter.suite"),
    (
        "suite run",
        "evodrive suite run golden/suite/starter.suite --driver examples/own_ego/idm.py --max-crash-rate 0.5",
    ),
    ("suite compare", "evodrive suite compare before.json after.json --suite golden/suite/starter.suite"),
    (
        "suite play",
        "evodrive suite play golden/suite/starter.suite --case king:synth/curve/20261126/3 --driver idm --driver standing --out play.html",
    ),
    ("leaderboard", "evodrive leaderboard golden/suite/starter.suite --driver idm --driver standing"),
    ("policy import", "evodrive policy import model.pt --out my_policy.safetensors"),
    ("fsck", "evodrive fsck --read"),
    ("report", "evodrive report"),
    ("watch", "evodrive watch runs/RUN"),
    ("table", "evodrive table metadrive-main --format csv"),
    ("claims", "evodrive claims --run runs/ONE --run runs/OTHER"),
    ("figure", "evodrive figure case-evolution --lineage cat-idm --out cat.svg"),
    ("paper", "evodrive paper --short --check"),
    ("why", "evodrive why proposals:cat-idm:accepted"),
    ("impact", "evodrive impact cat-idm/e1s0"),
    ("world", "evodrive world"),
    ("credit", "evodrive credit cat-idm/e1s0"),
    ("compare", "evodrive compare runs/ONE:cat-idm/parent runs/ONE:cat-idm"),
    ("diff", "evodrive diff runs/ONE runs/OTHER"),
    ("data", "evodrive data --out tables"),
    ("bundle create", "evodrive bundle create runs/RUN --out run.evodrive"),
    ("bundle inspect", "evodrive bundle inspect golden/bundles/frozen-1.evodrive"),
    ("bundle verify", "evodrive bundle verify golden/bundles/frozen-1.evodrive"),
    ("bundle import", "evodrive bundle import golden/bundles/frozen-1.evodrive --out my_copy"),
    ("agree", "evodrive agree runs/ONE runs/OTHER"),
    ("agree init", "evodrive agree init mine --scenes my.pool"),
    ("options", "evodrive options"),
    ("families", "evodrive families"),
    ("formats", "evodrive formats"),
    ("features", "evodrive features --json"),
    ("completions", "evodrive completions bash > ~/.local/share/bash-completion/completions/evodrive"),
    ("man", "evodrive man --out man"),
    ("worker", "evodrive worker"),
    ("shard plan", "evodrive shard plan experiments/quickstart.toml --whole-lineages"),
    ("shard work", "evodrive shard work runs/RUN/shards/0.shard"),
    ("shard merge", "evodrive shard merge experiments/quickstart.toml --audit 0.05"),
    ("shard withdraw", "evodrive shard withdraw 3f9a12c4 --reason faulty-node"),
    ("train", "evodrive train experiments/train/sac-metadrive.toml"),
    ("downstream", "evodrive downstream experiments/downstream/metadrive.toml"),
    ("egos", "evodrive egos examples/own_ego/idm.toml"),
    ("harden", "evodrive harden golden/suite/pdm.suite --scenes other.pool --out hardened"),
    ("transfer", "evodrive transfer --run runs/quickstart-5a1d8c3e --scenes other.pool --figure transfer.svg"),
    ("bench sim", "evodrive bench sim --pool my.pool"),
    ("bench env", "evodrive bench env --pool my.pool"),
    ("bench ledger", "evodrive bench ledger --scratch empty"),
    ("bench shards", "evodrive bench shards --pool my.pool --folder empty"),
];

/// The command line with its examples.
pub fn with_examples(command: Command) -> Command {
    below(command, "")
}

fn below(command: Command, path: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_string()).collect();
    let example = EXAMPLES.iter().find(|(of, _)| *of == path);
    let command = match example {
        Some((_, text)) => {
            let before = command.get_after_help().map(|help| format!("{help}\n\n")).unwrap_or_default();
            command.after_help(format!("{before}Example:\n  {text}"))
        }
        None => command,
    };
    names.into_iter().fold(command, |command, name| {
        let own = if path.is_empty() { name.clone() } else { format!("{path} {name}") };
        command.mut_subcommand(&name, |sub| below(sub, &own))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::Arguments;
    use clap::CommandFactory;

    fn leaves(command: &Command, path: &str, found: &mut Vec<String>) {
        for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
            let own = format!("{path} {}", sub.get_name()).trim_start().to_string();
            // One that can stand alone is a command, whatever may follow it.
            if sub.has_subcommands() {
                leaves(sub, &own, found);
            }
            if !sub.is_subcommand_required_set() {
                found.push(own);
            }
        }
    }

    #[test]
    fn every_command_has_an_example_and_every_example_is_a_command() {
        let mut wanted = Vec::new();
        leaves(&Arguments::command(), "", &mut wanted);
        for path in &wanted {
            assert!(EXAMPLES.iter().any(|(of, _)| of == path), "no example of `{path}`");
        }
        for (path, text) in EXAMPLES {
            assert!(wanted.iter().any(|of| of == path), "`{path}` is no command");
            assert!(text.starts_with(&format!("evodrive {path}")), "{text}");
            // A shell takes what stands behind `>`.
            let words = text.split('>').next().unwrap_or_default().split_whitespace();
            let parsed = with_examples(Arguments::command()).try_get_matches_from(words);
            assert!(parsed.is_ok(), "{text}: {}", parsed.unwrap_err());
        }
    }
}
