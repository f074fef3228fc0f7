//! Tests of the fit of generalised play operators.
