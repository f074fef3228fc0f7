//! `i2ris record trial`: runs the trials of a study, from a participant at the console to a
//! recording with marks.

use std::ffi::OsStr;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris_record::trial::journal::{Event, Journal, Outcome, TrialState, time};
use i2ris_record::trial::participant::{Condition, Participant, SCALES, Workload, order};
use i2ris_record::trial::runner::Plan;
use i2ris_record::trial::{Study, StudyError, TrialFolder};
use i2ris_report::preflight::Preflight;
use i2ris_report::{DomainOption, Failure, bail};
use serde_json::Map;

#[derive(Debug, clap::Args)]
pub struct InStudy {
    /// Folder of the study
    #[arg(long, value_name = "FOLDER", env = "I2RIS_STUDY", default_value = ".")]
    study: PathBuf,
}

impl InStudy {
    /// Opens the named study, or that in this folder, or the one with a running trial.
    fn open(&self) -> Result<Study, StudyError> {
        match Study::open(&self.study) {
            Err(StudyError::NoStudy { .. }) if self.study.as_os_str() == "." => match &*running() {
                [study] => Study::open(study),
                _ => Study::open(&self.study),
            },
            opened => opened,
        }
    }
}

/// Studies with a trial being recorded in this domain, by the command lines of recorders.
fn running() -> Vec<PathBuf> {
    let domain = std::env::var_os("I2RIS_DOMAIN").unwrap_or_else(|| "i2ris".into());
    let study = |process: &Path| {
        let line = std::fs::read(process.join("cmdline")).ok()?;
        let words: Vec<_> = line.split(|byte| *byte == 0).map(OsStr::from_bytes).collect();
        let after = |name: &str| words.get(words.iter().position(|word| *word == name)? + 1);
        let is_recorder = Path::new(*words.first()?).file_name()? == "i2ris-record";
        // A relative path starts at the folder of the process.
        let trial = process.join("cwd").join(after("--study")?).canonicalize().ok()?;
        (is_recorder && *after("--domain")? == domain)
            .then(|| trial.parent().map(Path::to_owned))?
    };
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.filter_map(|process| study(&process.path())).collect()
}

#[derive(Debug, clap::Subcommand)]
#[command(
    arg_required_else_help = true,
    after_help = "Examples:
  i2ris record trial new reach-study --condition joystick,keyboard
  i2ris record trial start --study reach-study --participant P07 --condition joystick --task reach
  i2ris record trial mark contact --study reach-study
  i2ris record trial stop --outcome success --study reach-study
  i2ris record trial workload --study reach-study
  i2ris record trial list --study reach-study

I2RIS_STUDY names the study for all of them. Participants are codes; names are refused."
)]
pub enum Task {
    /// Create a study with balanced conditions (a Latin square), and print their order for each
    /// participant
    New {
        /// The new folder
        study: PathBuf,
        /// Conditions to compare, e.g. joystick,keyboard
        #[arg(long, required = true, value_delimiter = ',', value_name = "NAMES")]
        condition: Vec<Condition>,
    },
    /// Start a trial; its recording runs until `stop`
    Start {
        #[command(flatten)]
        study: InStudy,
        #[command(flatten)]
        domain: DomainOption,
        /// Code of the participant, e.g. P07
        #[arg(long, value_name = "CODE")]
        participant: Participant,
        /// Condition of the study
        #[arg(long, value_name = "NAME")]
        condition: Condition,
        /// Name of the task
        #[arg(long, value_name = "NAME", default_value = "")]
        task: String,
        /// Note to store
        #[arg(long, value_name = "TEXT", default_value = "")]
        note: String,
    },
    /// Mark this moment of the running trial
    Mark {
        /// Text of the mark
        text: String,
        #[command(flatten)]
        study: InStudy,
    },
    /// Stop the running trial
    Stop {
        /// Outcome of the trial
        #[arg(long, value_enum)]
        outcome: Outcome,
        /// Note to store
        #[arg(long, value_name = "TEXT", default_value = "")]
        note: String,
        #[command(flatten)]
        study: InStudy,
    },
    /// Ask the participant for the workload of a trial: six scales of NASA-TLX
    Workload {
        /// Name of the trial, e.g. P07-joystick-02 [default: the last one that ended]
        name: Option<String>,
        /// Answers from a paper form, e.g. 55,30,25,60,50,20
        #[arg(long, value_name = "SIX")]
        answers: Option<Workload>,
        #[command(flatten)]
        study: InStudy,
    },
    /// List all trials and the order of conditions for participants; or show one trial with its
    /// marks
    List {
        /// Name of a trial, e.g. P07-joystick-02
        #[arg(conflicts_with = "json")]
        name: Option<String>,
        #[command(flatten)]
        study: InStudy,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

pub fn run(task: Task) -> Result<(), Failure> {
    // Before anything else: a mark has the time of its request.
    let now = clock::now();
    match task {
        Task::New { study, condition } => {
            let software = format!("i2ris {}", env!("CARGO_PKG_VERSION"));
            let made = Study::create(&study, condition, &software)?;
            println!("made: {}; `i2ris record trial start --study {0}`", study.display());
            orders(&made);
        }
        Task::Start { study, domain, participant, condition, task, note } => {
            let folder = study.study;
            let study = Study::open(&folder)?;
            let _one_at_a_time = study.lock()?;
            for name in study.close_cut_off()? {
                println!("{name} was truncated: closed as aborted; its recording is kept");
            }
            let recorder = std::env::current_exe()?;
            let domain = domain.domain()?;
            let (preflight, is_go) = Preflight::before_trial(&domain, now);
            let trial = study.start(&Plan {
                participant: &participant,
                condition: &condition,
                task: &task,
                note: &note,
                preflight: &preflight,
                domain: domain.name(),
                recorder: &recorder,
            })?;
            println!(
                "{} is being recorded; `i2ris record trial stop --outcome success --study {}` ends \
                 it",
                trial.name,
                folder.display()
            );
            if !is_go {
                eprintln!("warning: {preflight}");
            }
        }
        Task::Mark { text, study } => {
            let (name, number) = study.open()?.mark(now, &text)?;
            println!("{name}: mark {number}, {text}");
        }
        Task::Stop { outcome, note, study } => {
            let trial = study.open()?.stop(outcome, &note)?;
            println!("{}", line(&trial));
        }
        Task::Workload { name, answers, study } => {
            let trial = study.open()?.ended(name.as_deref())?;
            let answers = answers.map_or_else(|| ask(&trial.name), Ok)?;
            Journal::open(&trial.folder)?.append(&Event::Workload { time: time(), answers })?;
            println!("{}: workload {:.0} of 100", trial.name, answers.mean());
        }
        Task::List { name: None, study, json } => list(&study.open()?, json)?,
        Task::List { name: Some(name), study, .. } => show(&study.open()?, &name)?,
    }
    Ok(())
}

/// Fills in the form on the terminal.
fn ask(trial: &str) -> Result<Workload, Failure> {
    println!("{trial}. Each answer is 0 to 100 in steps of 5.");
    let mut answers = [0; SCALES.len()];
    for (answer, (name, question, [low, high])) in answers.iter_mut().zip(SCALES) {
        *answer = loop {
            println!("{name}: {question} (0 {low} ... 100 {high})");
            let mut line = String::new();
            if io::stdin().read_line(&mut line)? == 0 {
                bail!("the form was not filled in; nothing is stored");
            }
            match Workload::answer(&line) {
                Ok(answer) => break answer,
                Err(error) => println!("{error}"),
            }
        };
    }
    Ok(Workload(answers))
}

fn line(trial: &TrialFolder) -> String {
    let state = &trial.state;
    let outcome = match (state.outcome, &state.failed) {
        (Some(outcome), _) => outcome.name(),
        (None, Some(_)) => "running, but no longer recorded".to_owned(),
        (None, None) => "running, or truncated".to_owned(),
    };
    let marks = match state.marks.len() {
        1 => "1 mark".to_owned(),
        count => format!("{count} marks"),
    };
    let name = &trial.name;
    let TrialState { started, task, note, .. } = state;
    format!("{name:<28} {started}  {outcome}, {marks}  {task} {note}").trim_end().to_owned()
}

fn list(study: &Study, json: bool) -> Result<(), Failure> {
    let trials = study.trials()?;
    if json {
        let value = |trial: TrialFolder| Ok((trial.name, serde_json::to_value(trial.state)?));
        let trials: serde_json::Result<Map<_, _>> = trials.into_iter().map(value).collect();
        println!("{}", serde_json::to_string_pretty(&trials?)?);
        return Ok(());
    }
    if trials.is_empty() {
        println!("no trial yet; `i2ris record trial start` starts one");
    }
    trials.iter().for_each(|trial| println!("{}", line(trial)));
    orders(study);
    Ok(())
}

/// Prints the square; participants beyond its last row start at the first again.
fn orders(study: &Study) {
    let conditions = &study.conditions;
    let rows = conditions.len() * (1 + conditions.len() % 2);
    for row in 0..rows {
        let names = order(conditions.len(), row).into_iter().map(|it| conditions[it].to_string());
        let names = names.collect::<Vec<_>>().join(", ");
        println!("participant {}, {}, ...: {names}", row + 1, row + 1 + rows);
    }
}

fn show(study: &Study, name: &str) -> Result<(), Failure> {
    let trial = study.trial(name)?;
    println!("{}", line(&trial));
    println!("  recording: {}", trial.recording().display());
    if !trial.state.preflight.is_empty() {
        println!("  {}", trial.state.preflight);
    }
    if let Some(why) = &trial.state.failed {
        println!("  not recorded to its end: {why}");
    }
    if trial.state.boots.len() > 1 {
        println!("  the controller was started {} times during the trial", trial.state.boots.len());
    }
    if let Some(workload) = trial.state.workload {
        let scales = SCALES.iter().zip(workload.0).map(|((name, ..), it)| format!("{name} {it}"));
        let scales = scales.collect::<Vec<_>>().join(", ");
        println!("  workload {:.0} of 100: {scales}", workload.mean());
    }
    for mark in &trial.state.marks {
        println!("  mark {:>3}  {}  {}", mark.number, mark.time, mark.text);
    }
    Ok(())
}
