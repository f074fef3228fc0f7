//! Prepared layers between scaled inputs and outputs: the same from counts to outputs and back.

use nalgebra::{SMatrix, SVector};

use super::layers::{PreparedLayer, Signal};
use super::parameters::NetworkParameters;
use crate::model::maths::regression::vector;

/// What a unit of the file is worth here, of the inputs and of the outputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    pub inputs: f64,
    pub outputs: f64,
}

/// A network of I inputs and O outputs. Its state is a part of some numbers that it is handed.
#[derive(Debug)]
pub(super) struct ScaledLayers<const I: usize, const O: usize> {
    /// Travel of the input that moves most between two steps.
    pub step: f64,
    layers: Vec<PreparedLayer>,
    /// Where its part of the numbers ends.
    pub end: usize,
    centre: SVector<f64, I>,
    scale: SVector<f64, I>,
    output_gain: SMatrix<f64, O, O>,
    output_offset: SVector<f64, O>,
    skip: SMatrix<f64, O, I>,
    /// Beyond a step it goes on with this gain.
    straight: SMatrix<f64, O, I>,
}

impl<const I: usize, const O: usize> ScaledLayers<I, O> {
    /// Of checked parameters. Its part of the state begins at `begin`.
    pub fn new(
        file: &NetworkParameters,
        si: Scale,
        straight: SMatrix<f64, O, I>,
        begin: usize,
    ) -> Self {
        let mut layers: Vec<PreparedLayer> = Vec::new();
        for layer in &file.layers {
            let last = layers.last().map(|last| (last.units(), last.end()));
            let (inputs, begin) = last.unwrap_or((I, begin));
            layers.push(PreparedLayer::new(layer, inputs, begin));
        }
        let skip = |output: usize, input: usize| {
            let gain = file.skip_gain.get(output).and_then(|row| row.get(input));
            gain.map_or(0.0, |gain| gain * si.outputs / si.inputs)
        };
        Self {
            step: file.step_counts * si.inputs,
            end: layers.last().map_or(begin, PreparedLayer::end),
            layers,
            centre: vector::<I>(&file.input_centre) * si.inputs,
            scale: vector::<I>(&file.input_scale) / si.inputs,
            output_gain: SMatrix::from_fn(|i, j| file.output_gain[i][j] * si.outputs),
            output_offset: vector::<O>(&file.output_offset) * si.outputs,
            skip: SMatrix::from_fn(skip),
            straight,
        }
    }

    /// One step on nothing but zeros: the state when only the present input is known.
    pub fn begin(&self, values: &mut [f64], input: &SVector<f64, I>) {
        for layer in &self.layers {
            layer.prepare(values);
        }
        self.take_step(values, input);
    }

    /// Takes a step to an input.
    pub fn take_step(&self, values: &mut [f64], input: &SVector<f64, I>) {
        let mut signal = Signal::<0>::zero();
        let scaled = (input - self.centre).component_mul(&self.scale);
        signal.values[..I].copy_from_slice(scaled.as_slice());
        for layer in &self.layers {
            signal = layer.step(&signal, values);
        }
    }

    /// The outputs within a step, and, with T = I, their slopes.
    fn evaluate<const T: usize>(
        &self,
        values: &[f64],
        input: &SVector<f64, I>,
    ) -> (SVector<f64, O>, SMatrix<f64, O, T>) {
        let mut signal = Signal::<T>::zero();
        let from_centre = input - self.centre;
        let scaled = from_centre.component_mul(&self.scale);
        signal.values[..I].copy_from_slice(scaled.as_slice());
        for (index, (slopes, scale)) in signal.slopes.iter_mut().zip(self.scale.iter()).enumerate()
        {
            slopes[index] = *scale;
        }
        for layer in &self.layers {
            signal = layer.evaluate(&signal, values);
        }
        let learned = self.output_gain * vector::<O>(&signal.values) + self.output_offset;
        let mean = learned + self.skip * from_centre;
        let slopes = SMatrix::<f64, O, T>::from_fn(|output, input| signal.slopes[input][output]);
        (mean, self.output_gain * slopes)
    }

    /// The input within a step from the last one that is nearest to some input.
    fn within_a_step(&self, last: &SVector<f64, I>, input: &SVector<f64, I>) -> SVector<f64, I> {
        input.zip_map(last, |to, from| {
            // Not a number stays.
            if (to - from).abs() > self.step { from + self.step.copysign(to - from) } else { to }
        })
    }

    /// The outputs at an input, after a state whose last step ended at `last`.
    pub fn mean(
        &self,
        values: &[f64],
        last: &SVector<f64, I>,
        input: &SVector<f64, I>,
    ) -> SVector<f64, O> {
        let near = self.within_a_step(last, input);
        let (mean, _) = self.evaluate::<0>(values, &near);
        mean + self.straight * (input - near)
    }

    /// As [`Self::mean`], and the slopes.
    pub fn mean_and_slopes(
        &self,
        values: &[f64],
        last: &SVector<f64, I>,
        input: &SVector<f64, I>,
    ) -> (SVector<f64, O>, SMatrix<f64, O, I>) {
        let near = self.within_a_step(last, input);
        let (mean, mut slopes) = self.evaluate::<I>(values, &near);
        slopes += self.skip;
        let beyond = input - near;
        for index in 0..I {
            if beyond[index] != 0.0 {
                slopes.set_column(index, &self.straight.column(index));
            }
        }
        (mean + self.straight * beyond, slopes)
    }
}
