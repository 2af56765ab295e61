//! When an ego has left its road, and when it has arrived: MetaDrive's rules.

/// MetaDrive: the ego has left the road this far beside its route, metres.
pub const OFF_ROAD_OFFSET_M: f64 = 4.0;
/// MetaDrive: the ego has arrived with more than this share of its route driven.
pub const ARRIVAL_SHARE: f64 = 0.95;
/// MetaDrive: a route shorter than this is driven from the start, metres.
pub const ROUTE_M_MIN: f64 = 2.0;
