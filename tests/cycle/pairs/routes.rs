//! Routes along an edge: a side of the hull, a wall, a joint limit. Motors that arrive at different
//! times leave the straight line there, and cross the edge unless the setpoints are checked.

use super::*;

/// Step of a route, as a fraction of the largest step allowed.
const STEP: f64 = 0.94;
/// Speed of a hand that moves beyond a limit and back, and its distance beyond, degrees.
const HAND_DEG_S: f64 = 10.0;
const BEYOND_DEG: f64 = 2.0;
/// Distance at which a goal counts as reached, and time after which it is given up.
const NEAR_DEG: f64 = 0.05;
pub const PATIENCE_MS: u64 = 600;

pub fn distance([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    (c - a).hypot(d - b)
}

pub fn plus(at: [f64; 2], by: [f64; 2], times: f64) -> [f64; 2] {
    [at[0] + times * by[0], at[1] + times * by[1]]
}

fn between(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|at: usize| from[at] + share * (to[at] - from[at]))
}

impl Situation {
    /// Draws a route in steps to a point at an edge, then in one step along the edge.
    pub(super) fn draw_route(&mut self) {
        let Some((from, to)) = self.edge() else { return };
        let here = self.present();
        let step = STEP * self.oracle.path.expected.step;
        let steps = (distance(here, from) / step).ceil().max(1.0);
        let share = (step / distance(from, to)).min(1.0);
        let lead = (1..=steps as u32).map(|step| between(here, from, f64::from(step) / steps));
        self.route = lead.chain([between(from, to, share)]).collect();
        (self.clutched, self.is_streaming, self.rate) = (false, true, [0.0; 2]);
    }

    /// Draws a hand that moves beyond a limit, along it outside, and back.
    pub(super) fn draw_hand(&mut self) {
        let Some(high) = self.oracle.limits.high else { return self.turn() };
        let mut at = self.present();
        let beyond = high[0] + self.random.within(0.5, BEYOND_DEG);
        let [there, back] = [0; 2].map(|_| self.random.within(-9.0, 9.0));
        let inside = high[0] - self.random.within(0.1, BEYOND_DEG);
        let step = HAND_DEG_S * 1e-3 * self.period as f64;
        self.hand.clear();
        for next in [[beyond, at[1]], [beyond, there], [inside, there], [inside, back]] {
            let steps = (distance(at, next) / step).ceil().max(1.0);
            self.hand.extend((1..=steps as u32).map(|k| between(at, next, f64::from(k) / steps)));
            at = next;
        }
        (self.clutched, self.is_streaming, self.rate) = (false, true, [0.0; 2]);
    }

    /// Keeps the goal of a route until the snake arrives.
    pub(super) fn follow_route(&mut self) {
        let Some(next) = self.route.front() else { return };
        self.goal = *next;
        self.waited += self.period;
        if distance(self.present(), self.goal) < NEAR_DEG || self.waited > PATIENCE_MS {
            self.route.pop_front();
            self.waited = 0;
        }
    }

    fn edge(&mut self) -> Option<([f64; 2], [f64; 2])> {
        let [one, other] = [0; 2].map(|_| self.random.within(-8.0, 8.0));
        let kind = self.random.below(3);
        match if self.misled.is_some() { 1 } else { kind } {
            0 if self.wire == Wire::Taut => {
                let first = self.random.below(self.hull.len() as u64) as usize;
                let corners = [first, (first + 1) % self.hull.len()];
                let angles = corners.map(|corner| {
                    let [a, b] = self.hull[corner].map(|counts| 0.998 * counts);
                    [GAIN_DEG * (a + b), GAIN_DEG * (b - a)]
                });
                let [from, to] = [one, other].map(|at| 0.5 + at / 16.0);
                let [start, end] = angles;
                Some((between(start, end, from), between(start, end, to)))
            }
            1 if self.zones_on => {
                let zone = self.random.below(3) as usize % self.zones.len().max(1);
                let zone = *self.zones.get(zone)?;
                let (normal, offset) = match zone.region.shape {
                    _ if zone.region.space == FixtureSpace::Tip => return None,
                    SimpleShape::HalfSpace { normal, offset } => (normal, offset),
                    SimpleShape::Ball { centre, radius } => {
                        let far = centre[0].hypot(centre[1]);
                        (centre.map(|part| part / far), far - radius)
                    }
                };
                let at = |along: f64| {
                    [offset * normal[0] - along * normal[1], offset * normal[1] + along * normal[0]]
                };
                Some((at(one), at(other)))
            }
            _ => {
                let high = self.oracle.limits.high?;
                let pitch = [[high[0], one], [high[0], other]];
                let yaw = [[one, high[1]], [other, high[1]]];
                let [from, to] = if self.random.one_in(2) { pitch } else { yaw };
                Some((from, to))
            }
        }
    }
}
