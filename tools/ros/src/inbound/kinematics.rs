//! Forward and inverse kinematics as required by CRTK. They move nothing and use no model: they are
//! the shape of the snake at its angles.

use i2ris::model::kinematic::bend_to;
use i2ris_report::snake::{Bend, Snake};

use crate::admission::checked;
use crate::message::{
    JOINTS, QueryForwardKinematics, QueryForwardKinematicsResponse, QueryInverseKinematics,
    QueryInverseKinematicsResponse,
};

/// Distance of the tip below which a position counts as reached, m.
const REACHED_M: f64 = 1e-6;

fn bend(jp: &[f64]) -> Result<Bend, String> {
    let given = checked(jp, JOINTS.len()).map_err(|reason| reason.to_string())?;
    Ok(Bend { pitch: given.position[0], yaw: given.position[1] })
}

pub(super) fn forward(
    snake: &Snake,
    request: &QueryForwardKinematics,
) -> QueryForwardKinematicsResponse {
    match bend(&request.jp) {
        Ok(bend) => {
            let (cp, message) = (snake.tip_pose(bend).into(), String::new());
            QueryForwardKinematicsResponse { cp, result: true, message }
        }
        Err(message) => QueryForwardKinematicsResponse { message, ..Default::default() },
    }
}

/// The orientation in the request is not used: pitch and yaw also determine the orientation.
pub(super) fn inverse(request: &QueryInverseKinematics) -> QueryInverseKinematicsResponse {
    let failed = |message| QueryInverseKinematicsResponse { message, ..Default::default() };
    let from = if request.jp.is_empty() { Ok(Bend::default()) } else { bend(&request.jp) };
    let from = match from {
        Ok(from) => from,
        Err(message) => return failed(message),
    };
    let place = &request.cp.position;
    let ([pitch, yaw], away_m) = bend_to([place.x, place.y, place.z], [from.pitch, from.yaw]);
    if !away_m.is_finite() {
        return failed("a position is not finite".to_owned());
    }
    let result = away_m <= REACHED_M;
    let message = match result {
        true => String::new(),
        false => format!("out of reach: the nearest pose is {:.3} mm away", away_m * 1e3),
    };
    QueryInverseKinematicsResponse { jp: vec![pitch, yaw], result, message }
}
