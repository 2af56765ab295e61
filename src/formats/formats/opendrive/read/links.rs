//! Links between lanes: from section to section, from road to road, and through junctions.

use std::collections::BTreeMap;

use super::{LaneName, Network, named};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::xml_read::Element;
use crate::scene::validate::LINKS_MAX;

/// An end of a road by its reference line.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Start,
    End,
}

type Roads<'d> = BTreeMap<&'d str, Element<'d>>;

/// Links of a road's lanes to the next section, or to the road before and after it. A link that leads nowhere is left out.
pub(super) fn within_and_between(
    network: &mut Network,
    id: &str,
    road: &Element<'_>,
    roads: &Roads<'_>,
    imported: &mut Imported,
) {
    let sections = network.sections.get(id).copied().unwrap_or(0);
    let beyond = ["predecessor", "successor"].map(|name| {
        let link = linked_road(network, road, name, roads);
        imported.read(&format!("{name} of {}", named(road)), link, "the road is kept without this link").flatten()
    });
    for (index, section) in road.child("lanes").iter().flat_map(|lanes| lanes.named("laneSection")).enumerate() {
        let groups = ["left", "right"].into_iter().filter_map(|side| section.child(side));
        for lane in groups.flat_map(|group| group.children()).filter(|child| child.name() == "lane") {
            let Some(own) = lane.attribute("id").and_then(|id| id.parse::<i64>().ok()) else { continue };
            let Some(link) = lane.child("link") else { continue };
            let ends = [("predecessor", End::Start), ("successor", End::End)];
            for ((name, end), beyond) in ends.into_iter().zip(&beyond) {
                let Some(other) = link.child(name).and_then(|e| e.attribute("id")).and_then(|id| id.parse().ok())
                else {
                    continue;
                };
                let next = match end {
                    End::Start => index.checked_sub(1).map(|before| (before, End::End)),
                    End::End => Some((index + 1, End::Start)).filter(|(after, _)| *after < sections),
                };
                let here = (id.to_string(), index, own);
                match (next, beyond) {
                    (Some((section, there)), _) => network.join(&here, end, &(id.to_string(), section, other), there),
                    (None, Some((road, section, there))) => {
                        network.join(&here, end, &(road.clone(), *section, other), *there);
                    }
                    (None, None) => {}
                }
            }
        }
    }
}

/// The road that a road's own link names, with the section and the end that touch; `None` for junctions and for
/// the road itself.
fn linked_road(
    network: &Network,
    road: &Element<'_>,
    name: &str,
    roads: &Roads<'_>,
) -> Result<Option<(String, usize, End)>, ImportError> {
    let Some(link) = road.child("link").and_then(|link| link.child(name)) else { return Ok(None) };
    if link.attribute("elementType") != Some("road") {
        return Ok(None);
    }
    let id = link.needed_attribute("elementId")?;
    if !roads.contains_key(id) {
        return Err(link.refuse(format!("the id of a road that can be read, found {:?}", shown(id))));
    }
    let end = contact(&link)?;
    // A road that is a ring: its lanes are read, but no lane leads into itself.
    if road.attribute("id") == Some(id) {
        return Ok(None);
    }
    Ok(Some((id.to_string(), network.section_at(id, end), end)))
}

fn contact(element: &Element<'_>) -> Result<End, ImportError> {
    match element.attribute("contactPoint") {
        Some("start") => Ok(End::Start),
        Some("end") => Ok(End::End),
        other => Err(element.refuse(format!("contactPoint start or end, found {:?}", shown(other.unwrap_or(""))))),
    }
}

/// Links from the roads that enter a junction to those that lead through it. A connection that leads nowhere is left out.
pub(super) fn through_junction(
    network: &mut Network,
    junction: &Element<'_>,
    roads: &Roads<'_>,
    imported: &mut Imported,
) {
    let kept = "the roads are kept without its links";
    let Some(id) = imported.read(&named(junction), junction.needed_attribute("id"), kept) else { return };
    for connection in junction.children().filter(|child| child.name() == "connection") {
        let what = || format!("{} of {}", named(&connection), named(junction));
        if let Err(error) = connect(network, id, &connection, roads, imported) {
            imported.leave_out_for(what(), &error, "the roads are kept without this link");
        }
    }
}

fn connect(
    network: &mut Network,
    junction_id: &str,
    connection: &Element<'_>,
    roads: &Roads<'_>,
    imported: &mut Imported,
) -> Result<(), ImportError> {
    let (Some(incoming), Some(connecting)) =
        (connection.attribute("incomingRoad"), connection.attribute("connectingRoad"))
    else {
        // Direct and virtual junctions link roads without a connecting road.
        return Ok(());
    };
    for id in [incoming, connecting] {
        if !roads.contains_key(id) {
            return Err(connection.refuse(format!("the id of a road that can be read, found {:?}", shown(id))));
        }
    }
    if incoming == connecting {
        return Err(connection.refuse("a connecting road other than the incoming one"));
    }
    let end = contact(connection)?;
    let touches = |name: &str| {
        let link = roads.get(incoming).and_then(|road| road.child("link")).and_then(|link| link.child(name));
        let junction = link.filter(|link| link.attribute("elementType") == Some("junction"));
        junction.is_some_and(|link| link.attribute("elementId") == Some(junction_id))
    };
    for (name, own_end) in [("predecessor", End::Start), ("successor", End::End)] {
        if !touches(name) {
            continue;
        }
        for link in connection.children().filter(|child| child.name() == "laneLink") {
            let lane = |name: &str| link.attribute(name).and_then(|id| id.parse::<i64>().ok());
            let (Some(from), Some(to)) = (lane("from"), lane("to")) else {
                let error = link.refuse("lane ids under from and to");
                imported.leave_out_for(
                    format!("laneLink of {}", named(connection)),
                    &error,
                    "the other links are kept",
                );
                continue;
            };
            let here = (incoming.to_string(), network.section_at(incoming, own_end), from);
            let there = (connecting.to_string(), network.section_at(connecting, end), to);
            network.join(&here, own_end, &there, end);
        }
    }
    Ok(())
}

impl Network {
    fn section_at(&self, road: &str, end: End) -> usize {
        match end {
            End::Start => 0,
            End::End => self.sections.get(road).map_or(0, |count| count.saturating_sub(1)),
        }
    }

    /// Links two lane ends that touch: the lane that ends there leads into the lane that begins there. There is no link
    /// if both end or both begin there, or if one of them is not read.
    fn join(&mut self, one: &LaneName, one_end: End, other: &LaneName, other_end: End) {
        let (Some(&a), Some(&b)) = (self.index.get(one), self.index.get(other)) else { return };
        let leaves = |lane: usize, end: End| self.forward[lane] == (end == End::End);
        let (from, to) = match (leaves(a, one_end), leaves(b, other_end)) {
            (true, false) => (a, b),
            (false, true) => (b, a),
            _ => return,
        };
        let lanes = &mut self.road.lanes;
        let room = lanes[from].exits.len() < LINKS_MAX && lanes[to].entries.len() < LINKS_MAX;
        if from != to && room && !lanes[from].exits.contains(&to) {
            lanes[from].exits.push(to);
            lanes[to].entries.push(from);
        }
    }
}
