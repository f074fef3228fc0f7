//! A camera: late, noisy, and with faults.

use std::collections::VecDeque;

use super::*;

/// Timing and faults of the frames.
#[derive(Debug, Clone, Copy)]
pub struct CameraPlan {
    pub frames_per_s: f64,
    /// Time from exposure to arrival.
    pub latency_ms: u64,
    /// Delay of the stamp after the exposure.
    pub stamp_late_ms: u64,
    pub noise_deg: f64,
    /// Share of frames that are anywhere within 5 deg.
    pub outliers: f64,
    pub seed: u64,
}

impl Default for CameraPlan {
    fn default() -> Self {
        Self {
            frames_per_s: 30.0,
            latency_ms: 60,
            stamp_late_ms: 0,
            noise_deg: 0.07,
            outliers: 0.03,
            seed: 1,
        }
    }
}

#[derive(Debug)]
pub struct Camera {
    pub plan: CameraPlan,
    random: Random,
    next: f64,
    pending: VecDeque<(Nanos, ExternalPose)>,
}

impl Camera {
    pub fn new(plan: CameraPlan) -> Self {
        Self { plan, random: Random::new(plan.seed), next: 0.0, pending: VecDeque::new() }
    }

    /// The frame that arrives in this tick, if any.
    pub fn frame(&mut self, now: Nanos, angles_deg: [f64; 2]) -> Option<ExternalPose> {
        if now.as_seconds() >= self.next {
            self.next = now.as_seconds().max(self.next) + 1.0 / self.plan.frames_per_s;
            let is_outlier = self.random.unit() < self.plan.outliers;
            let angles = angles_deg.map(|angle| {
                let noise = self.plan.noise_deg * self.random.normal();
                let off = if is_outlier { self.random.within(-5.0, 5.0) } else { 0.0 };
                (angle + noise + off).to_radians()
            });
            let pose = camera_frame(
                now + Nanos::from_millis(self.plan.stamp_late_ms),
                [angles[0], angles[1], 0.0],
            );
            let arrival = now + Nanos::from_millis(self.plan.latency_ms);
            self.pending.push_back((arrival, pose));
        }
        let is_due = self.pending.front().is_some_and(|(arrival, _)| *arrival <= now);
        if !is_due {
            return None;
        }
        self.pending.pop_front().map(|(_, pose)| pose)
    }
}
