//! Words for prompts on what holds around every search and what the ego heeds; a family's source says what its own search compares.
//! Whoever changes an ego changes its text here.

/// Of the observation `metadrive-1`.
const METADRIVE_LEARNED: &str = "learned is a network with frozen weights that chooses steering and pedal anew \
     every 0.1 s from what it sees then, without memory or chance; it may brake (up to 8.8 m/s^2), turn the wheels by \
     up to 40 degrees at once, swerve and leave its lane. It sees all around: 24 rays to bodies of any kind (50 m), \
     the six nearest road users within 50 m with place, velocity, heading, size and place along its route, the road's \
     edge on 12 rays (30 m), its route 20 m ahead, a red light (50 m), and the body ahead that idm would see (20 m). \
     Nobody's intention is known, and what it makes of all this its weights decide.";

/// Describes what holds around the search of every family of a protocol: what predictions are of, what filters and choices
/// do. `safebench`: true if the contract's backend is that one; `compact`: leaves out what words and contract say.
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

/// Describes what an ego heeds, by the name that `ego::Policy::name` gives it; [`learned_in_words`] describes learned ones.
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

/// Describes what a learned ego sees and can do, by the name of its observation (`ego::Setting::name`).
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
