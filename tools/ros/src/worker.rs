//! A thread that sends requests to the controller and waits for its answers, so that nothing else
//! has to wait for a controller that hangs.

use std::io;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

/// Maximum number of waiting tasks.
pub const WAITING: usize = 16;

/// Does one task after the other. Ends when it is dropped, once its last task is done.
#[derive(Debug)]
pub struct Worker<T> {
    tasks: Option<SyncSender<T>>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> Worker<T> {
    /// Starts a thread of this name. At most `waiting` tasks wait.
    pub fn start(
        name: &str,
        waiting: usize,
        mut work: impl FnMut(T) + Send + 'static,
    ) -> io::Result<Self> {
        let (tasks, to_do) = sync_channel(waiting);
        let run = move || to_do.into_iter().for_each(&mut work);
        let thread = thread::Builder::new().name(name.to_owned()).spawn(run)?;
        Ok(Self { tasks: Some(tasks), thread: Some(thread) })
    }

    /// `false`: too many tasks wait already.
    pub fn ask(&self, task: T) -> bool {
        self.tasks.as_ref().is_some_and(|tasks| tasks.try_send(task).is_ok())
    }
}

impl<T> Drop for Worker<T> {
    fn drop(&mut self) {
        self.tasks = None;
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
