//! An ego that is stepped from outside: a program file is read and compiled for each scene, the ego looks, decides and steps, and
//! the outcome is that of a rollout. Without arguments a published parent plays scenes of SafeBench's families.
//!
//! `cargo run --example own_loop -- my_program.json my.pool`

use evodrive::compiler::{Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::experiment::{ProgramFile, read_scenes};
use evodrive::kernel::{Seed, Threads};
use evodrive::scene::{PreparedScene, safebench::TrafficFamily};
use evodrive::sim::{Control, Episode};
use evodrive::{families, objects::FamilyName, synth::family_scene};
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (file, scenes) = match &std::env::args().skip(1).collect::<Vec<String>>()[..] {
        [program, pool] => {
            (ProgramFile::read(program.as_ref())?, read_scenes(&[pool.into()], &Threads::none())?.scenes)
        }
        _ => (
            ProgramFile::published(&FamilyName::new("human"))?,
            [TrafficFamily::StraightObstacle, TrafficFamily::RightTurn].map(|of| family_scene(of, 5, Seed(7))).to_vec(),
        ),
    };
    let (families, rules) = (families::sources(), file.conditions.simulator);
    let program = Prepared::new(&file.program, families.get(&file.family).ok_or("no such family")?)?;
    for scene in scenes {
        let situation = Situation::under(PreparedScene::new(Arc::new(scene)), &Policy::Idm, &rules)?;
        let act = program.compile(&situation, Seed(file.conditions.seed))?.intervention;
        let mut episode = Episode::new(&situation.plant, &act)?.keeping_controls();
        while episode.end().is_none() {
            let view = episode.observe();
            let (ego, route) = (view.ego(), view.route());
            let aim = route.at(ego.along.s_m + 6.0, ego.along.segment) - ego.sample.position;
            let steering_rad = 5.4 * ego.axis.cross(aim) / aim.norm_squared().max(1.0);
            let acceleration_mps2 = if view.front().is_some_and(|front| front.gap_m < 15.0) { -4.0 } else { 1.0 };
            episode.step(Control::Drive { acceleration_mps2, steering_rad })?;
        }
        println!("{}: {:?}", situation.scene_id(), episode.assessed()?.map(|outcome| (outcome.end, outcome.contact)));
    }
    Ok(())
}
