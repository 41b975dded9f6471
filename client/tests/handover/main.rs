//! What the engine's threads hand over, in every order that a model checker finds.
//!
//! The letter boxes and the board are the engine's own files, compiled against loom's locks: a wake-up that
//! is lost, a deadlock or news that is overtaken shows in one of some thousand orders, always. The threads are
//! the engine's in small: the traversal publishes what it wants and has, and demands; the loader answers
//! demands with events; the caller sets views, waits for the last to be complete, and ends both.

#[path = "../../src/engine/mailbox.rs"]
#[allow(dead_code)]
mod mailbox;
#[path = "../../src/engine/notice.rs"]
#[allow(dead_code)]
mod notice;
mod sync;

use std::time::Duration;

use loom::{future::block_on, model::Builder, sync::Arc, thread};

use self::{mailbox::MailBox, notice::Notice};

#[derive(Debug, Default)]
struct TraversalMail {
    view: u32,
    is_new: bool,
    arrived: Vec<u32>,
    shutdown: bool,
}

impl TraversalMail {
    fn collect(&mut self) -> Option<Self> {
        let is_news = self.is_new || !self.arrived.is_empty() || self.shutdown;
        let (view, is_new) = (self.view, std::mem::take(&mut self.is_new));
        let arrived = std::mem::take(&mut self.arrived);
        is_news.then_some(Self { view, is_new, arrived, shutdown: self.shutdown })
    }
}

#[derive(Debug, Default)]
struct LoaderMail {
    demand: Option<u32>,
    shutdown: bool,
}

impl LoaderMail {
    fn collect(&mut self) -> Option<Self> {
        (self.demand.is_some() || self.shutdown).then(|| std::mem::take(self))
    }
}

#[derive(Debug, Default, Clone, Copy)]
struct Plan {
    sequence: u32,
    view: u32,
    settled: bool,
}

struct Shared {
    traversal: MailBox<TraversalMail>,
    loader: MailBox<LoaderMail>,
    board: Notice<Plan>,
}

impl Shared {
    fn new() -> Arc<Self> {
        Arc::new(Self {
            traversal: MailBox::new(TraversalMail::default()),
            loader: MailBox::new(LoaderMail::default()),
            board: Notice::default(),
        })
    }

    fn set_view(&self, view: u32) {
        self.traversal.put(|mail| {
            mail.view = view;
            mail.is_new = true;
            ((), true)
        });
    }

    fn traverse(&self) {
        let (mut has, mut sequence) = (0, 0);
        loop {
            let mail = self.traversal.take(TraversalMail::collect);
            if mail.shutdown {
                return;
            }
            has = mail.arrived.into_iter().fold(has, u32::max);
            sequence += 1;
            let settled = has == mail.view;
            self.board.post(|plan| *plan = Plan { sequence, view: mail.view, settled });
            if !settled {
                self.loader.put(|loader| (loader.demand = Some(mail.view), true));
            }
        }
    }

    async fn load(&self) {
        loop {
            let mail = self.loader.taken(LoaderMail::collect).await;
            if mail.shutdown {
                return;
            }
            if let Some(view) = mail.demand {
                self.traversal.put(|mail| (mail.arrived.push(view), true));
            }
        }
    }

    fn shut_down(&self) {
        self.traversal.put(|mail| (mail.shutdown = true, true));
        self.loader.put(|mail| (mail.shutdown = true, true));
    }
}

/// In all orders with no more than so many threads stopped in the middle of something.
fn check(preemptions: usize, run: impl Fn() + Send + Sync + 'static) {
    let mut builder = Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.check(run);
}

#[test]
fn the_last_view_is_always_completed_and_all_threads_end() {
    check(2, || {
        let shared = Shared::new();
        let traversal = thread::spawn({
            let shared = Arc::clone(&shared);
            move || shared.traverse()
        });
        let loader = thread::spawn({
            let shared = Arc::clone(&shared);
            move || block_on(shared.load())
        });
        shared.set_view(1);
        shared.set_view(2);
        let is_done = |plan: &Plan| (plan.view == 2 && plan.settled).then_some(*plan);
        let plan = shared.board.wait(Duration::MAX, is_done).expect("there is no end of time");
        assert!(plan.sequence <= 4, "views are not queued: {plan:?}");
        shared.shut_down();
        traversal.join().expect("ends");
        loader.join().expect("ends");
    });
}

#[test]
fn a_thread_that_is_told_to_end_ends_whatever_it_is_doing() {
    check(3, || {
        let shared = Shared::new();
        let traversal = thread::spawn({
            let shared = Arc::clone(&shared);
            move || shared.traverse()
        });
        let loader = thread::spawn({
            let shared = Arc::clone(&shared);
            move || block_on(shared.load())
        });
        shared.set_view(1);
        shared.shut_down();
        traversal.join().expect("ends");
        loader.join().expect("ends");
    });
}

#[test]
fn everyone_who_waits_at_the_board_is_told() {
    check(3, || {
        let board = Arc::new(Notice::<u32>::default());
        let waiting = [1, 2].map(|number| {
            let board = Arc::clone(&board);
            thread::spawn(move || {
                board.wait(Duration::MAX, |&news| (news >= number).then_some(())).expect("told");
            })
        });
        board.post(|news| *news = 1);
        board.post(|news| *news = 2);
        waiting.into_iter().for_each(|thread| thread.join().expect("ends"));
    });
}
