//! Models on emulated snakes of many physics, in simulated time.
//!
//! For every snake: record a calibration, fit, and follow motions that are in no calibration, with
//! the real cycle of the controller. Python judges any model, compared with the exact inverse of
//! the snake; `i2ris bench models` judges the benefit of adaptation on snakes that wear.

mod exact_inverse;
pub(crate) mod laboratory;
pub(crate) mod subject;
pub(crate) mod tracking;

pub use laboratory::{RecordingPlan, robot};
pub use tracking::{tick_times, tracked};

use i2ris_calibration::fit::Choice;
use i2ris_calibration::parallel;
use i2ris_report::Failure;
use i2ris_report::statistics::median;
use i2ris_simulation::physics::{DrawnSnake, Physics};

use subject::{CAMERAS, Judgement, MINUTES, Minutes};

/// Arguments of `i2ris bench models`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris bench models --family force-balance --draws 1
  i2ris bench models --family force-balance --snake gear,wire

Nothing moves and no process starts: drives and snakes are simulated. A snake takes a minute of
computing. Families against each other, and models by others: python -m i2ris.benchmark_table.")]
pub struct Arguments {
    /// Physics of the snakes [default: all of them]
    #[arg(long, value_name = "PHYSICS,..", value_delimiter = ',')]
    snake: Vec<Physics>,
    /// Snakes of each physics
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    draws: u64,
    /// Seed of the first snake of each physics; the others follow
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print as JSON
    #[arg(long)]
    json: bool,
    /// Family to fit; `best` fits all and selects as `i2ris calibrate fit` does
    #[arg(long, default_value = "best")]
    family: Choice,
}

impl Arguments {
    fn snakes(&self) -> Vec<DrawnSnake> {
        let physics = if self.snake.is_empty() { Physics::ALL } else { &self.snake };
        let seeds = self.seed..self.seed + self.draws;
        let drawn =
            |&physics: &Physics| seeds.clone().map(move |seed| DrawnSnake { physics, seed });
        physics.iter().flat_map(drawn).collect()
    }
}

/// Judges all snakes and prints a line for each as soon as it is done, then a table or JSON.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let snakes = arguments.snakes();
    let judged: Vec<Result<Judgement, Failure>> = parallel::map(snakes.len(), |index| {
        let snake = snakes[index];
        let Arguments { family, seed, .. } = *arguments;
        let judged = Judgement::of(snake, family, seed, folder.path());
        match &judged {
            Ok(judgement) => eprintln!("{}", row(&snake.to_string(), &[judgement])),
            Err(reason) => eprintln!("{snake}: {reason}"),
        }
        judged
    });
    let judgements: Vec<Judgement> = judged.iter().flatten().cloned().collect();
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&judgements)?);
    } else {
        println!(
            "RMS error of the tip, deg, minute by minute, within the limits of a robot as \
             delivered; limits off: without any; aged: gaps +40 %, preload -30 %, \
             friction +25 %; recalibrated: by a model of the aged snake. Medians over the snakes. \
             `regret`: error of the selected family over the smallest error; the maximum."
        );
        for physics in Physics::ALL.iter().map(ToString::to_string) {
            let of: Vec<_> = judgements.iter().filter(|it| it.physics == physics).collect();
            if !of.is_empty() {
                println!("{}", row(&physics, &of));
            }
        }
        println!("{}", row("all", &judgements.iter().collect::<Vec<_>>()));
    }
    match judged.iter().filter(|judged| judged.is_err()).count() {
        0 => Ok(()),
        failed => Err(format!("{failed} of {} snakes could not be judged", snakes.len()).into()),
    }
}

/// Medians over the snakes: a line for every camera.
fn row(name: &str, of: &[&Judgement]) -> String {
    let minutes = |errors: &dyn Fn(&Judgement) -> Minutes| {
        let of = |minute: usize| {
            let mut errors: Vec<f64> = of.iter().map(|judged| errors(judged)[minute]).collect();
            format!("{:.3}", median(&mut errors).unwrap_or(f64::NAN))
        };
        std::array::from_fn::<_, { MINUTES }, _>(of).join(" ")
    };
    let [new, adapted] = [0, 1].map(|at: usize| minutes(&|it| it.new[at]));
    let mut text = format!("{name}\n  new   {new}   adapted {adapted}");
    text += &format!("\n  limits off {}", minutes(&|it| it.limits_off));
    let [aged, anew] = [minutes(&|it| it.aged), minutes(&|it| it.anew)];
    text += &format!("\n  aged  {aged}   recalibrated {anew}");
    for (index, (age_ms, noise_deg)) in CAMERAS.iter().enumerate() {
        let found = minutes(&|it| it.adapted[index]);
        text += &format!("\n  adapted {found} (frames {age_ms} ms old, {noise_deg} deg)");
    }
    let regret = of.iter().filter_map(|judged| judged.regret).reduce(f64::max);
    text + &regret.map_or_else(String::new, |regret| format!("\n  regret {regret:.2}"))
}
