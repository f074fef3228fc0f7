//! Prepared layers between scaled counts and outputs.

use nalgebra::{SMatrix, SVector};

use super::layers::{PreparedLayer, Signal};
use super::parameters::NetworkParameters;
use crate::model::maths::vector;

/// A network from D motors to M outputs, rad (m). Its state is some numbers that it is handed.
#[derive(Debug)]
pub(super) struct ScaledLayers<const D: usize, const M: usize> {
    /// Travel of the motor that moves most between two steps, counts.
    pub step: f64,
    layers: Vec<PreparedLayer>,
    centre: SVector<f64, D>,
    scale: SVector<f64, D>,
    output_gain: SMatrix<f64, M, M>,
    output_offset: SVector<f64, M>,
    skip: SMatrix<f64, M, D>,
    /// Gain used beyond a step.
    straight: SMatrix<f64, M, D>,
}

impl<const D: usize, const M: usize> ScaledLayers<D, M> {
    /// Prepares checked parameters, with outputs scaled by `si`.
    pub(super) fn new(file: &NetworkParameters, si: f64, straight: SMatrix<f64, M, D>) -> Self {
        let mut layers: Vec<PreparedLayer> = Vec::new();
        for layer in &file.layers {
            let last = layers.last().map(|last| (last.units, last.end()));
            let (inputs, begin) = last.unwrap_or((D, 0));
            layers.push(PreparedLayer::new(layer, inputs, begin));
        }
        let skip = |output: usize, input: usize| {
            let gain = file.skip_gain.get(output).and_then(|row| row.get(input));
            gain.map_or(0.0, |gain| gain * si)
        };
        Self {
            step: file.step_counts,
            layers,
            centre: vector::<D>(&file.input_centre),
            scale: vector::<D>(&file.input_scale),
            output_gain: SMatrix::from_fn(|i, j| file.output_gain[i][j] * si),
            output_offset: vector::<M>(&file.output_offset) * si,
            skip: SMatrix::from_fn(skip),
            straight,
        }
    }

    /// One step on nothing but zeros: the state when only the present input is known.
    pub(super) fn begin(&self, values: &mut [f64], input: &SVector<f64, D>) {
        for layer in &self.layers {
            layer.prepare(values);
        }
        self.take_step(values, input);
    }

    pub(crate) fn take_step(&self, values: &mut [f64], input: &SVector<f64, D>) {
        let mut signal = Signal::<0>::zero();
        let scaled = (input - self.centre).component_mul(&self.scale);
        signal.values[..D].copy_from_slice(scaled.as_slice());
        for layer in &self.layers {
            signal = layer.step(&signal, values);
        }
    }

    /// The outputs within a step, and, with T = D, their slopes.
    fn evaluate<const T: usize>(
        &self,
        values: &[f64],
        input: &SVector<f64, D>,
    ) -> (SVector<f64, M>, SMatrix<f64, M, T>) {
        let mut signal = Signal::<T>::zero();
        let from_centre = input - self.centre;
        let scaled = from_centre.component_mul(&self.scale);
        signal.values[..D].copy_from_slice(scaled.as_slice());
        for (index, (slopes, scale)) in signal.slopes.iter_mut().zip(self.scale.iter()).enumerate()
        {
            slopes[index] = *scale;
        }
        for layer in &self.layers {
            signal = layer.evaluate(&signal, values);
        }
        let learned = self.output_gain * vector::<M>(&signal.values) + self.output_offset;
        let mean = learned + self.skip * from_centre;
        let slopes = SMatrix::<f64, M, T>::from_fn(|output, input| signal.slopes[input][output]);
        (mean, self.output_gain * slopes)
    }

    /// The input within a step from the last one that is nearest to some input.
    fn within_a_step(&self, last: &SVector<f64, D>, input: &SVector<f64, D>) -> SVector<f64, D> {
        input.zip_map(last, |to, from| {
            // Not a number stays.
            if (to - from).abs() > self.step { from + self.step.copysign(to - from) } else { to }
        })
    }

    /// The outputs at an input, after a state whose last step ended at `last`.
    pub(super) fn mean(
        &self,
        values: &[f64],
        last: &SVector<f64, D>,
        input: &SVector<f64, D>,
    ) -> SVector<f64, M> {
        let near = self.within_a_step(last, input);
        let (mean, _) = self.evaluate::<0>(values, &near);
        mean + self.straight * (input - near)
    }

    /// Returns [`Self::mean`] and the slopes.
    pub(crate) fn mean_and_slopes(
        &self,
        values: &[f64],
        last: &SVector<f64, D>,
        input: &SVector<f64, D>,
    ) -> (SVector<f64, M>, SMatrix<f64, M, D>) {
        let near = self.within_a_step(last, input);
        let (mean, mut slopes) = self.evaluate::<D>(values, &near);
        slopes += self.skip;
        let beyond = input - near;
        for index in 0..D {
            if beyond[index] != 0.0 {
                slopes.set_column(index, &self.straight.column(index));
            }
        }
        (mean + self.straight * beyond, slopes)
    }
}
