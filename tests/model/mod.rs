//! Tests of the model runtime through its public interface.

mod conformance;
mod file;
mod force_balance;
mod gmr;
mod hull;
mod inverse;
mod linear;
mod network;
mod plays;
mod refusals;

use i2ris::model::file::{
    FamilyParameters, HullParameters, Mixture, MixtureParameters, ModelFile, OutputUnit,
};
use i2ris::model::hysteresis::Operator;
use i2ris::model::network::Activation;
use i2ris::model::{Estimate, History, Inverse, Memory, Model, Query};
use i2ris::units::{MotorVec, OutputVec};
use i2ris_testing::families::{self, *};
use nalgebra::SVector;
use proptest::collection::vec;
