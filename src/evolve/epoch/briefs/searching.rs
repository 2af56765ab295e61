//! What a family's search compares and what the ego heeds, in words for prompts. A contract says which words a program
//! may use; it does not say what they act on: whether a list is ranked or a motion is walked to, on which scale
//! scores lie, which edit another one hides. Whoever changes a family's search, its parent's figures or an ego changes
//! its text here.

/// Of the observation `metadrive-1`.
const METADRIVE_LEARNED: &str = "learned is a network with frozen weights that chooses steering and pedal anew \
     every 0.1 s from what it sees then, without memory or chance; it may brake (up to 8.8 m/s^2), turn the wheels by \
     up to 40 degrees at once, swerve and leave its lane. It sees all around: 24 rays to bodies of any kind (50 m), \
     the six nearest road users within 50 m with place, velocity, heading, size and place along its route, the road's \
     edge on 12 rays (30 m), its route 20 m ahead, a red light (50 m), and the body ahead that idm would see (20 m). \
     Nobody's intention is known, and what it makes of all this its weights decide.";

/// What the search of a source family goes through, what it ranks, on which scale, and one edit with its effect.
/// Figures are the parent's. `None` for a family that is not known here.
pub fn search_in_words(family: &str) -> Option<&'static str> {
    Some(match family {
        "cat" => {
            "The search compares up to 32 likely trajectories of one vehicle by log prior plus log contact: one unit \
             is a factor e. The prior part mostly lies between -5 and -1.5 (equal from the seventh on, \
             `flatten_rank`); a predicted contact loses 0.01 per half second before it; without one the score is -1000 \
             less the nearest metres. `candidate_score` is added (0.1 to 3 reorders contacts, and lifts no miss above \
             one) or, with `combine` = replace, is all, without the -1000. A `reshape` or filter before the search \
             counts in it. Example: `if(struck_by_ego, 2, 0) - jerk_added_mps3 / 10` prefers gentle contacts that the \
             ego runs into."
        }
        "at" => {
            "The search moves a swarm: 10 particles, 100 rounds, each particle offsets of at most 1 m from one \
             vehicle's log; each one's best becomes a candidate. Its loss is the smallest centre distance to the ego's \
             undisturbed path (m) less the mean offset toward it; the best gains at most about 2 on the log, so a term \
             of 1 matters. `offset_loss` (smaller is better) is added or replaces it and steers the swarm; in \
             `offset_gradient` it only ranks the restarts. A `reshape` before the search changes nothing; behind, it \
             keeps the score. Example: `jerk_added_mps3 / 5 - if(struck_by_ego, 1, 0)` prefers contacts that the ego \
             causes."
        }
        "adv_bmt" => {
            "Nothing is optimised: 8 motions (`sample_count`) of one inserted body are grown backward from a \
             collision imposed on the ego's undisturbed path at the window's end, and scored as drawn: 0, -1, .. -7; \
             below -500 off the road, about -1000 for one that hardly moves or spins. `sample_score` is added (one \
             unit is one place) or replaces the order of those not rejected. A `reshape` before the search is judged, \
             but moves the body off the imposed meeting; no laws act; actor features and `log_way_share` are \
             constants. Example: `-jerk_mps3_max / 2`: one 2 m/s^3 smoother overtakes one drawn a place before."
        }
        "king" => {
            "The search walks: Adam moves steering and throttle of 2 vehicles (`group_size`), 120 iterations, 20 after \
             the first contact, with the ego simulated at each; at most 9 iterates, picked by its own loss, become \
             candidates. They score 0 for contacts that an expert could avoid, -1000 for misses, -2000 for other \
             contacts, less a loss squeezed below 400: mean metres to the ego, road, bystanders, 2 x implausibility. \
             `iterate_loss` (smaller is better; added, or replacing the loss) ranks within a step of 1000 and steers \
             nothing; `pursuer_weight` steers. A `reshape` before the search changes nothing. Example: \
             `jerk_added_mps3 / 2` prefers smooth iterates."
        }
        "llm_attacker" => {
            "The search plays up to 4 attacks of up to 3 vehicles (`pool_size`) with 32 trajectories each, scored as \
             log prior plus log contact (-5 to -1.5; below -1000 without): the leader's best, then, by why it failed, \
             another trajectory or vehicle. The first contact, else the nearest, gets +10000, so no temperature \
             matters. `attack_score` (added or replacing) orders a vehicle's own trajectories; `attacker_score` \
             (pool's own: -0.5 to 2.5) orders vehicles, a place counting 0.5 against 2 for reach and `counsel_weight` \
             4. A `reshape` before the search is played; behind it, the changed motion is untried. Example: \
             `attack_score` `if(struck_by_ego, 2, 0)` tries those first."
        }
        "sage" => {
            "The search compares up to 32 trajectories (`kept_count`) that two mixed experts find most probable for \
             one vehicle; no score brings in others. Ranked is w x danger - (1 - w) x penalty - 50 off the road - 10 \
             through a bystander, w 0.5: danger is 10 (1 - t/T) for a predicted contact at t of T, else at most 1, the \
             penalty 2.1 straight on: contacts score -1 to 4, a second earlier is worth 0.6. `preference_score` is \
             added or replaces all, the -50 too. A `reshape` before the search is judged. Example: `if(struck_by_ego, \
             3, 0) - wrong_way_m / 10` prefers contacts that the ego causes."
        }
        "seal" => {
            "The search compares up to 32 trajectories of one vehicle by 0 to 1: half criticality (1 on contact, else \
             exp(-gap / 8 m)), half deviation of an ego predicted to brake by up to 5 m/s^2. `opponent_score` is added \
             (0.05 to 0.5 is enough) or replaces it. The trajectory is followed only until 1.1 s before the predicted \
             meeting (`handover_lead_s`, or a `skill_lead_s` module in its place); then skills react and no path or \
             shape counts, unless a law replaces them. A `reshape` before the search is judged; behind, score and \
             hand-over stay. Example: `0.2 * log_way_share - jerk_added_mps3 / 50` prefers motion like the log's."
        }
        "strive" => {
            "The search walks: Adam moves latents (0 is the log) of 3 vehicles (`group_size`), 200 iterations, 30 \
             after the first contact, with the ego simulated at each; at most 9 iterates, picked by its own loss, \
             become candidates. Contacts score 0 less the loss without its crash term, misses -1000 less all of it, \
             each with 2 x implausibility, squeezed below 400; contacts without a way out are dropped. `latent_score` \
             (larger is better; added, or replacing the loss) ranks within a step of 1000 and steers nothing; \
             `attacker_weight` steers. A `reshape` before the search changes nothing. Example: `-jerk_added_mps3 / 5` \
             prefers smooth iterates."
        }
        "advsim" => {
            "The search plays at most 8 scenarios (`speed_query_count`): 100 target speeds, one each 0.1 s after the \
             trigger, of one scripted road user on a straight way, first random, then each time a changed stretch \
             (half) of the best so far. The loss is the smallest distance in metres, -10 on contact, which ends the \
             search. A `speed_loss` (smaller is better, always added) makes it play all 8, steers it and chooses among \
             contacts; 10 outweighs one. Speeds beyond `speed_ceiling` are never tried; filters act behind; there is \
             no `reshape`, no law. Example: `acceleration_mps2_max / 4` takes the gentler contact."
        }
        "adv_traj" => {
            "The search plays at most 8 scenarios (`lateral_query_count`): 100 points of one scripted road user's \
             straight path, moved sideways by at most 1, 2 or 3 m (by traffic family, times `lateral_share`), first \
             random, then each time a changed stretch (half) of the best so far. The loss is the smallest distance in \
             metres, -10 on contact, which ends the search. A `lateral_loss` (smaller is better, always added) makes \
             it play all 8, steers it and chooses among contacts; 10 outweighs one. Filters act behind; there is no \
             `reshape`, no law. Example: `yaw_rate_radps_max * 2` takes the contact with less swerving."
        }
        "chatscene" => {
            "The search plays 12 scenarios (`template_samples`) drawn from the six ranges of the scene's kind, which \
             shrink after every 4 to mean and spread of what collided (if two did). Ranked is 10 less the share of the \
             route driven on contact (9 to 10), else minus the smallest metres. `template_score` is always added and \
             ranks what was played; it steers neither draws nor shrinking, and 10 outweighs a contact. Ranges and \
             behaviours of a kind (`roadside`, `turning`, `lane_change`, `passing`, `crossing`, `oncoming`) act in its \
             scenes alone; filters act behind; no `reshape`, no law. Example: `-acceleration_mps2_max / 4` takes a \
             gentler contact."
        }
        "human" => {
            "Nothing is searched: the 9 or 10 members of the traffic family's grid are each played once, all score 0, \
             and the parent's `soft_choice` draws one evenly, whether or not it collided. `grid_score` is the whole \
             score: at `temperature` 0.5 one unit makes a member e^2 = 7.4 times likelier; without it the temperature \
             changes nothing. `best_choice` takes the highest, of equals the first. A middle such as \
             `right_turn_trigger_m` acts in scenes of its traffic family alone, `grid_reach` in all; filters before or \
             behind remove members; no `reshape`, no law. Example: `-ego_distance_m_min` prefers members that come \
             nearest to the undisturbed ego's way."
        }
        _ => return None,
    })
}

/// What holds around the search of every family of a protocol: what predictions are of, what filters and choices do.
/// `safebench`: whether the contract's backend is that one; `compact`: without what words and contract say.
pub fn around_search_in_words(safebench: bool, compact: bool) -> &'static str {
    if compact && !safebench {
        "What expressions say of a candidate against the ego is predicted against the one path that it drove on the \
         recorded scene, so it knows of no adversary: a predicted contact may be braked away, and a motion that is not \
         predicted to meet it may. What temperature means hangs on the scale of the scores. Vehicles moved together \
         take one iterate. Filters leave scores as they are; in front of a search that makes the motion itself they \
         see only where it starts. `reshape` behind a search keeps the unchanged motion's score. A law is no part of \
         any score or filter."
    } else if safebench {
        "Every candidate is a whole scenario that was simulated once against the ego; its motion is what the scripted \
         road user did there, until the ego's first contact. Contact and nearness in the search's own score are of \
         that simulation, but features (`collision_likelihood`, `struck_by_ego`, `ego_distance_m_min`, ..) compare \
         that motion with the path that the ego takes with nobody staged, so they may say no contact where there was \
         one. Features of the actor (`gap_m` 200, ..), `log_deviation_m_max` (0), `log_way_share` (1) and \
         `prior_log_probability` (0) are constants. There are no laws, no `reshape`, and one kind each of actor and \
         timing. A filter in front of a search that draws its own scenarios changes nothing."
    } else {
        "What expressions say of a candidate against the ego (`collision_likelihood`, `struck_by_ego`, \
         `ego_distance_m_min`, ..) is predicted against the one path that it drove on the recorded scene, so it knows \
         of no adversary: a predicted contact may be braked away, and a motion that is not predicted to meet it may. \
         `best_choice` takes the highest score, of equals the earlier; `soft_choice` draws by exp(score / \
         temperature), so what temperature means hangs on the scale of the scores. Where several vehicles are moved \
         together one iterate is taken for all. Filters remove candidates by their motion and leave scores as they \
         are; in front of a search that makes the motion itself they see only where it starts. `reshape` behind a \
         search keeps the score that the unchanged motion had. A law is no part of any score or filter."
    }
}

/// What an ego heeds, by the name that `ego::Policy::name` gives it; of learned ones [`learned_in_words`] tells.
pub fn ego_in_words(name: &str) -> &'static str {
    match name {
        "idm" => {
            "idm follows its route's line and never swerves or changes lane; it aims at 11.1 m/s whatever the speed \
             limit (on SafeBench's routes 8 m/s, less before bends) and heeds no light. It sees one body: the nearest \
             of any kind (vehicle, cyclist, pedestrian, standing object) whose centre is ahead of its own along the \
             route, at most 20 m from it, and whose box reaches within 1 m of the route's line; it does not see who is \
             beside or behind, or who is about to enter that strip. It decides every 0.1 s without delay, and wants so \
             large a gap (64 m behind one as fast at 10 m/s, 37 m at 5 m/s) that at these speeds whoever it sees makes \
             it brake fully at once, 8.8 m/s^2 (from 11 m/s it stands after about 7 m), but for one that is about 2 \
             m/s faster; standing, it starts only if that body is 10 m or more ahead, centre to centre."
        }
        "idm-lights" => {
            "idm-lights follows its route's line and never swerves or changes lane; it aims at 11.1 m/s whatever the \
             speed limit (on SafeBench's routes 8 m/s, less before bends) and takes a red light's stop point on its \
             route, from 20 m on, for a standing body. It sees one body: the nearest of any kind (vehicle, cyclist, \
             pedestrian, standing object) whose centre is ahead of its own along the route, at most 20 m from it, and \
             whose box reaches within 1 m of the route's line; it does not see who is beside or behind, or who is \
             about to enter that strip. It decides every 0.1 s without delay, and wants so large a gap (64 m behind \
             one as fast at 10 m/s, 37 m at 5 m/s) that at these speeds whoever it sees makes it brake fully at once, \
             8.8 m/s^2 (from 11 m/s it stands after about 7 m), but for one that is about 2 m/s faster; standing, it \
             starts only if that body is 10 m or more ahead, centre to centre."
        }
        "pdm" => {
            "pdm follows its route's line or a line 1 m beside it, whichever of fifteen ways (three lines, five speeds \
             up to the lane's limit, 15 m/s where there is none) scores best over the next 4 s. Each is driven behind \
             whoever it will meet first in a strip of its own width (IDM with gaps of 1 m and 1.5 s, braking of at most \
             3 m/s^2), and scored against a forecast of everybody within 50 m, on all sides, of whom each keeps speed \
             and heading: contacts for which the ego would be at fault (not those from behind), leaving the road, driving \
             against traffic, progress, contacts within 0.9 s ahead, comfort. It expects nobody to brake, turn or start; it \
             stops at red lights; at 5 m/s or less a contact forecast within 2 s makes it brake fully. Whom it has touched \
             it no longer sees. It decides every 0.1 s."
        }
        "frenet" => {
            "frenet samples manoeuvres along its route: to speeds from 8.6 m/s below its own to 2 m/s above, and to offsets \
             of up to 3 m beside the route, that end after 0.4 to 6 s. Of those that its car can drive (at most 4.9 m/s^2 to \
             the side) and that keep to the road it drives the cheapest (smooth, near the lane's limit or 15 m/s, near the \
             route) that meets nobody within 6 s with 1 m of room ahead and 0.3 m aside; else it brakes fully. It forecasts \
             everybody within 50 m, on all sides, of whom each keeps speed and heading, and gives way to who would drive into \
             its side, but not to who comes from behind; it expects nobody to brake, turn or start, and stops at red lights. \
             Whom it has touched it no longer sees. It plans anew every 0.3 s."
        }
        "replay" => {
            "replay repeats its recorded motion whatever happens: it heeds nobody, never brakes or swerves for anyone, \
             and the recorded traffic repeats its log too, also behind it. So a followed candidate that is predicted \
             to touch it does, unless another contact ends the rollout before."
        }
        "command" => {
            "command is a planner of the experimenter's own: a fixed function of what it is told since the rollout \
             began, at each 0.1 s its own state, everybody within 100 m with place, velocity and size, the lights and, \
             where it asked, the map near it; what of that it heeds is not known here. Labels are its own drives. \
             Searches that simulate the ego again ask idm in its place, so their contacts may not be its contacts; its \
             drive on the undisturbed scene, against which features are predicted, is its own."
        }
        _ => "a fixed ego; what it heeds is not known here",
    }
}

/// What a learned ego sees and can do, by the name of its observation (`ego::Setting::name`).
pub fn learned_in_words(observation: &str) -> &'static str {
    match observation {
        "metadrive-1" => METADRIVE_LEARNED,
        "safebench-1" => {
            "learned on SafeBench's routes is a network with frozen weights that sees four numbers every 0.1 s: its \
             distance beside the route and its turn against it 4.5 m ahead, its speed, and whether a body ahead \
             reaches within 1 m of the route's line with its centre less than 15 m away. It knows neither how near nor \
             how fast that one is, and sees nobody beside, behind or still coming toward the route. It may brake (3.3 \
             m/s^2 at most), speed up (3 m/s^2) and steer (21 degrees at most)."
        }
        "safebench-2" => {
            "learned on SafeBench's routes is a network with frozen weights that sees four numbers every 0.1 s: its \
             distance beside the route and its turn against it 4.5 m ahead, its speed, and whether a vehicle or cyclist \
             ahead has its centre in the same lane and less than 15 m away. It knows neither how near nor how fast that \
             one is, and sees no walker, no standing thing, and nobody in another lane, beside or behind. It may brake \
             (3.3 m/s^2 at most), speed up (3 m/s^2) and steer (21 degrees at most)."
        }
        _ => "a network with frozen weights; what it sees is not known here",
    }
}
