//! A checked and prepared model for the control loop.

use std::path::Path;

use crate::file_permissions::{MAX_MODEL_BYTES, read_trusted};
use crate::model::error::ModelError;
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, MemoryTerms, OutputUnit, Query};
use crate::model::examination::Examination;
use crate::model::families::hysteresis::force_balance::{CREEPING, REACH};
use crate::model::families::memory::Memory;
use crate::model::families::prepare;
use crate::model::families::runtime::{Reach, Runtime, Search};
use crate::model::file::{self, FamilyParameters, ModelFile};
use crate::model::history::History;
use crate::model::maths::bounded;
use crate::model::maths::hull::Hull;
use crate::robot::ModelId;
use crate::units::{MotorVec, OutputVec};

/// A checked and prepared model. It is immutable and can be shared between threads.
///
/// Every method except construction and [`Model::recall`] is suitable for the control loop: bounded
/// work, no allocation, no panic.
#[derive(Debug)]
pub struct Model {
    file: ModelFile,
    id: ModelId,
    motors: usize,
    hull: Hull,
    reach: Reach,
    conditioning_range: MotorVec,
    /// Output change per count, averaged over the hull.
    slope: JacobianMatrix,
    runtime: Box<dyn Runtime>,
}

impl Model {
    /// Reads, checks and prepares a model file.
    ///
    /// # Errors
    ///
    /// The errors of [`ModelFile::read`] and [`Model::from_file`]. Every error names the file.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        Self::from_file(ModelFile::read(path)?).map_err(|error| error.in_file(path))
    }

    /// Loads a file as [`Model::load`], but only if no other user can write it: for the controller.
    ///
    /// # Errors
    ///
    /// See [`Model::load`]; also [`ModelError::Untrusted`].
    pub fn load_trusted(path: &Path) -> Result<Self, ModelError> {
        let text = read_trusted(path, MAX_MODEL_BYTES).map_err(|error| match error.into_io() {
            Ok(source) => ModelError::Read { path: path.to_owned(), source },
            Err(untrusted) => ModelError::Untrusted(untrusted),
        })?;
        let file = ModelFile::parse(&text).map_err(|error| error.in_file(path))?;
        Self::from_file(file).map_err(|error| error.in_file(path))
    }

    /// Checks and prepares a model.
    ///
    /// # Errors
    ///
    /// When a value is out of its valid range, the prediction at the inverse of a prediction is off
    /// by more than one count's worth somewhere in the hull, or the model fails its
    /// [`Examination`].
    pub fn from_file(file: ModelFile) -> Result<Self, ModelError> {
        let motors = file::check(&file)?;
        let hull = Hull::new(&file.hull, motors)?;
        let runtime = prepare(&file.family, [motors, file.outputs.len()], unit(&file))?;
        runtime.check_round_trip(&hull, unit(&file))?;
        let conditioning_range = clamp_to_extent(runtime.conditioning_range(), &hull);
        let slope = mean_slope(&*runtime, &hull);
        let (id, reach) = (file.id()?, runtime.reach(&hull));
        let model = Self { id, file, motors, hull, reach, conditioning_range, slope, runtime };
        model.examine().verdict()?;
        Ok(model)
    }

    /// How the inverse does on the model itself. [`Self::from_file`] refuses a model that fails.
    #[must_use]
    pub fn examine(&self) -> Examination {
        Examination::of(&*self.runtime, &self.reach, &self.file)
    }

    /// Checks that a robot may use the model.
    ///
    /// # Errors
    ///
    /// See [`Self::check_robot`]; also when the model is marked as worthless.
    pub fn check_use(&self, robot_id: &str, motors: usize) -> Result<(), ModelError> {
        self.check_robot(robot_id, motors)?;
        let doubt = self.file.worthless.clone();
        doubt.map_or(Ok(()), |doubt| Err(ModelError::Worthless(doubt)))
    }

    /// Checks that the model belongs to a robot.
    ///
    /// # Errors
    ///
    /// When it was calibrated on another robot or is for another number of motors.
    pub fn check_robot(&self, robot_id: &str, motors: usize) -> Result<(), ModelError> {
        if self.file.robot_id != robot_id {
            return Err(ModelError::Robot {
                model: self.file.robot_id.clone(),
                robot: robot_id.to_owned(),
            });
        }
        if self.motors != motors {
            return Err(ModelError::Motors { model: self.motors, robot: motors });
        }
        Ok(())
    }

    /// The file from which the model was prepared.
    #[must_use]
    pub fn file(&self) -> &ModelFile {
        &self.file
    }

    /// The identity of the model.
    #[must_use]
    pub fn id(&self) -> ModelId {
        self.id
    }

    /// Number of motors, 1 or 2.
    #[must_use]
    pub fn motors(&self) -> usize {
        self.motors
    }

    /// Number of outputs, 1 to 3.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.file.outputs.len()
    }

    /// The region of motor space that calibration visited.
    #[must_use]
    pub fn hull(&self) -> &Hull {
        &self.hull
    }

    /// The most that an output changes by with a count of every motor, on the average over the
    /// hull, rad (m).
    pub(crate) fn count_worth(&self) -> f64 {
        let worths = self.slope.iter().map(|line| line.iter().map(|slope| slope.abs()).sum());
        worths.fold(0.0, f64::max)
    }

    /// A memory without any past motion.
    #[must_use]
    pub fn new_memory(&self) -> Memory {
        Memory::default()
    }

    /// Whether the bend also depends on time: the snake creeps.
    #[must_use]
    pub fn creeps(&self) -> bool {
        matches!(&self.file.family, FamilyParameters::ForceBalance { balance, .. }
            if balance.creep != [0.0; CREEPING])
    }

    /// Updates a memory with the present position `counts`. Call this with every measured position,
    /// oldest first. A position that is not finite is ignored.
    ///
    /// No time passes: a snake that creeps is stiffer then than over time. See
    /// [`Model::advance_over`].
    pub fn advance(&self, memory: &mut Memory, counts: &MotorVec) {
        self.advance_over(memory, counts, 0.0);
    }

    /// Updates a memory `time_s` after the previous position. Call it also while the motors hold
    /// still: a creeping snake still moves then. Models without creep ignore the time.
    pub fn advance_over(&self, memory: &mut Memory, counts: &MotorVec, time_s: f64) {
        if counts.iter().all(|c| c.is_finite()) {
            memory.note(*counts);
            self.runtime.advance(memory, counts, time_s.max(0.0));
        }
    }

    /// The memory of this model after the motion in a history. Not for the control loop: it takes
    /// thousands of steps.
    #[must_use]
    pub fn recall(&self, history: &History) -> Memory {
        let mut memory = self.new_memory();
        for (counts, time_s) in history.steps() {
            self.advance_over(&mut memory, counts, time_s);
        }
        memory
    }

    /// Whether a memory covers enough motion that all earlier motion is forgotten. Until then
    /// predictions may be off by the width of the hysteresis loop. For families without memory this
    /// is true after the first position.
    #[must_use]
    pub fn is_memory_known(&self, memory: &Memory) -> bool {
        memory.covered(&self.conditioning_range)
    }

    /// The conditioning range: the range that every motor must cover until earlier motion is
    /// forgotten, counts; 0 for families without memory. It is limited to the width of the
    /// calibrated hull, because calibration cannot cover more.
    #[must_use]
    pub fn conditioning_range(&self) -> MotorVec {
        self.conditioning_range
    }

    /// Whether the model has gaps that drift may widen: [`Memory::set_gap_scale`].
    #[must_use]
    pub fn has_backlash(&self) -> bool {
        self.runtime.has_backlash()
    }

    /// Half the calibrated gear play of every motor, as a share of half the calibrated range: the
    /// maximum that [`Wear::play`](crate::model::Wear) subtracts. 0 for models without
    /// gears.
    #[must_use]
    pub fn gear_play(&self) -> MotorVec {
        let mut play = MotorVec::default();
        if let FamilyParameters::ForceBalance { balance, .. } = &self.file.family {
            for (play, motor) in play.iter_mut().zip(&balance.motors) {
                *play = motor.gap / REACH;
            }
        }
        play
    }

    /// The part of [`Model::predict`] that depends on the memory alone and changes slowly, rad (m).
    /// See [`crate::model::hysteresis`].
    #[must_use]
    pub fn correction(&self, memory: &Memory) -> OutputVec {
        self.memory_terms(memory).correction
    }

    /// [`Model::correction`] and the other terms that depend on the memory alone.
    #[must_use]
    pub fn memory_terms(&self, memory: &Memory) -> MemoryTerms {
        self.runtime.memory_terms(memory)
    }

    /// The virtual counts after a straight motion from the present position to `counts`: the input
    /// of the regression. For families without virtual counts, `counts` itself.
    #[must_use]
    pub fn virtual_counts(&self, counts: &MotorVec, memory: &Memory) -> MotorVec {
        self.runtime.virtual_counts(counts, memory)
    }

    /// The outputs after a straight motion from the present position to `counts`. They are finite
    /// for every finite position. Outside the hull the model extrapolates, and their deviation
    /// grows. A NaN position gives a NaN estimate.
    #[must_use]
    pub fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        self.extrapolated(counts, self.runtime.predict(counts, memory))
    }

    /// Predicts as [`Model::predict`], with precomputed [`Model::memory_terms`].
    #[must_use]
    pub fn predict_with(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        terms: &MemoryTerms,
    ) -> Estimate {
        self.extrapolated(counts, self.runtime.predict_with(counts, memory, terms))
    }

    /// An estimate with what is not known outside the hull.
    fn extrapolated(&self, counts: &MotorVec, mut estimate: Estimate) -> Estimate {
        let mut counts = bounded(counts);
        counts.iter_mut().skip(self.motors).for_each(|unused| *unused = 0.0);
        if self.hull.excess(&counts) > 0.0 {
            let edge = self.hull.project(&counts);
            let beyond = std::array::from_fn(|motor| counts[motor] - edge[motor]);
            estimate.extrapolate(&beyond, &self.slope);
        }
        estimate
    }

    /// The mean of [`Model::predict`] alone, with a [`Model::correction`], rad (m).
    #[must_use]
    pub fn pose(&self, counts: &MotorVec, memory: &Memory, correction: &OutputVec) -> OutputVec {
        self.runtime.pose(counts, memory, correction)
    }

    /// [`Model::pose`] with [`Model::jacobian`]: computed together they cost little more than one.
    #[must_use]
    pub fn pose_and_slope(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix) {
        self.runtime.pose_and_slope(counts, memory, correction)
    }

    /// Derivative of the predicted mean with respect to the counts, rad (m) per count.
    #[must_use]
    pub fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix {
        self.runtime.jacobian(counts, memory)
    }

    /// The counts that bring the outputs to `goal`, rad (m), from the present position in the
    /// memory. The result lies in the hull for every goal. Rounded to whole counts it may lie up to
    /// half a count outside.
    ///
    /// - A goal that no position in the hull reaches gives the nearest position by distance in
    ///   output space, marked `clipped`.
    /// - With more outputs than motors the result is the nearest position. `clipped` then means
    ///   that the hull limits the result.
    /// - With more motors than outputs, the result is the solution near the start.
    /// - A goal that is not finite gives the start, projected into the hull, marked `clipped`, with
    ///   an infinite residual.
    #[must_use]
    pub fn invert(&self, goal: &OutputVec, memory: &Memory, query: &Query) -> Inverse {
        self.runtime.invert(goal, Search { memory, reach: &self.reach, query })
    }

    /// The inverses of several goals near each other, with the same memory. The search for the
    /// first starts as [`Model::invert`], all others start at its result.
    #[must_use]
    pub fn invert_each<const N: usize>(
        &self,
        goals: &[OutputVec; N],
        memory: &Memory,
        query: &Query,
    ) -> [Inverse; N] {
        self.invert_within(&self.reach, goals, memory, query)
    }

    /// Inverts as [`Model::invert_each`], with counts in a smaller hull.
    pub(crate) fn invert_within<const N: usize>(
        &self,
        reach: &Reach,
        goals: &[OutputVec; N],
        memory: &Memory,
        query: &Query,
    ) -> [Inverse; N] {
        let mut found = [Inverse::default(); N];
        self.runtime.invert_each(goals, Search { memory, reach, query }, &mut found);
        found
    }

    /// Region of the inverse between the lowest and the highest counts of every motor; the whole
    /// hull if their intersection is empty. Not for the control loop.
    pub(crate) fn reach_between(&self, low: MotorVec, high: MotorVec) -> Reach {
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        let within = Hull::from_points(self.motors, &corners).and_then(|limits| {
            let is_inside = self.hull.corners().all(|corner| limits.contains(&corner));
            if is_inside { Ok(self.hull.clone()) } else { self.hull.common(&limits, self.motors) }
        });
        match within {
            Ok(hull) if hull != self.hull => self.runtime.reach(&hull),
            Ok(_) | Err(_) => self.reach.clone(),
        }
    }
}

/// The extent of the hull along every motor, counts; 0 for motors that it does not have.
fn extents(hull: &Hull) -> MotorVec {
    let [low, high] = hull.bounds();
    std::array::from_fn(|motor| high[motor] - low[motor])
}

fn clamp_to_extent(mut ranges: MotorVec, hull: &Hull) -> MotorVec {
    for (range, extent) in ranges.iter_mut().zip(extents(hull)) {
        *range = range.min(extent);
    }
    ranges
}

/// Output change per count of every motor over the extent of the hull, straight from its centre:
/// wider than any backlash, unlike a slope at a position.
fn mean_slope(runtime: &dyn Runtime, hull: &Hull) -> JacobianMatrix {
    let mut slope = JacobianMatrix::default();
    for (motor, extent) in extents(hull).into_iter().enumerate().filter(|(_, wide)| *wide > 0.0) {
        let [low, high] = [-0.5, 0.5].map(|part| {
            let mut counts = hull.centre();
            counts[motor] += part * extent;
            runtime.predict(&counts, &Memory::default()).mean
        });
        for (line, (low, high)) in slope.iter_mut().zip(low.into_iter().zip(high)) {
            line[motor] = (high - low) / extent;
        }
    }
    slope
}

/// The unit of all outputs. [`file::check`] makes sure that they share one unit.
fn unit(file: &ModelFile) -> OutputUnit {
    file.outputs.first().map_or(OutputUnit::Deg, |output| output.unit)
}

impl ModelFile {
    /// Checks the model like [`Model::from_file`] and writes it atomically.
    ///
    /// # Errors
    ///
    /// When the model is refused, or the file cannot be written. An earlier file at `path` is then
    /// unchanged.
    pub fn write(&self, path: &Path) -> Result<(), ModelError> {
        Model::from_file(self.clone()).map_err(|error| error.in_file(path))?;
        self.save(path)
    }
}
