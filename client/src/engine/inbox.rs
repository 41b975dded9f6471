//! The letter boxes of the two threads.
//!
//! Each is one mutex around everything that can be new, and one way to wake its reader, which
//! checks for news under that mutex: no wake-up can be lost, and there is no second monitor to
//! lock in another order. The view and the demand are latest-wins; events queue up, bounded by the
//! loader, which stops asking while too much of what it delivered is unread.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::{event::Event, occlusion::Drawn, piece::Piece, settings::Settings, view::View};
use crate::source::Source;

/// What the traversal thread reads.
#[derive(Debug)]
pub(super) struct TraversalInbox {
    state: Mutex<TraversalMail>,
    news: Condvar,
    /// The same news for a reader that is a task. Stores one permit.
    told: tokio::sync::Notify,
}

/// The newest of everything.
#[derive(Debug)]
pub(super) struct TraversalMail {
    /// The view, and how often it has changed.
    pub view: Option<View>,
    /// Wanted attributes, where they have changed.
    pub attributes: Option<Vec<String>>,
    /// The settings.
    pub settings: Settings,
    /// Counts changes of the view, the attributes, the settings and the clouds.
    pub generation: u64,
    /// The newest picture, where one has been drawn since.
    pub drawn: Option<Drawn>,
    /// From the loader, and from the caller where clouds come and go; oldest first.
    pub events: Vec<Event>,
    /// Events ever posted.
    pub posted: u64,
    /// Whether to end.
    pub shutdown: bool,
    /// Whether the view or a setting is new.
    is_changed: bool,
}

impl TraversalInbox {
    pub fn new(settings: Settings) -> Self {
        let mail = TraversalMail {
            view: None,
            attributes: None,
            settings,
            generation: 0,
            drawn: None,
            events: Vec::new(),
            posted: 0,
            shutdown: false,
            is_changed: false,
        };
        Self { state: Mutex::new(mail), news: Condvar::new(), told: tokio::sync::Notify::new() }
    }

    /// Sets the view; the same view again is no news. Calls `changed` with the new generation
    /// before the traversal can see it. Returns the generation.
    pub fn set_view(&self, view: View, changed: impl FnOnce(u64)) -> u64 {
        let mut mail = lock(&self.state);
        if mail.view != Some(view) {
            mail.view = Some(view);
            mail.is_changed = true;
            mail.generation += 1;
            changed(mail.generation);
            self.tell();
        }
        mail.generation
    }

    /// Sets the wanted attributes. Returns the generation.
    pub fn set_attributes(&self, attributes: Vec<String>, changed: impl FnOnce(u64)) -> u64 {
        let mut mail = lock(&self.state);
        mail.attributes = Some(attributes);
        mail.generation += 1;
        changed(mail.generation);
        self.tell();
        mail.generation
    }

    /// Changes the settings; the same settings again are no news. Returns the generation.
    pub fn set(&self, change: impl FnOnce(&mut Settings), changed: impl FnOnce(u64)) -> u64 {
        let mut mail = lock(&self.state);
        let before = mail.settings.clone();
        change(&mut mail.settings);
        if mail.settings != before {
            mail.is_changed = true;
            mail.generation += 1;
            changed(mail.generation);
            self.tell();
        }
        mail.generation
    }

    /// Posts that a cloud comes or goes.
    pub fn change_clouds(&self, event: Event, changed: impl FnOnce(u64)) {
        let mut mail = lock(&self.state);
        mail.events.push(event);
        mail.posted += 1;
        mail.generation += 1;
        changed(mail.generation);
        self.tell();
    }

    /// Tells of a picture; one that was not read yet is forgotten.
    pub fn set_drawn(&self, drawn: Drawn) {
        lock(&self.state).drawn = Some(drawn);
        self.tell();
    }

    /// The newest generation, and whether there is a view at all.
    pub fn generation(&self) -> (u64, bool) {
        let mail = lock(&self.state);
        (mail.generation, mail.view.is_some())
    }

    /// Posts an event; returns its number, counting from 1.
    pub fn post(&self, event: Event) -> u64 {
        let mut mail = lock(&self.state);
        mail.events.push(event);
        mail.posted += 1;
        self.tell();
        mail.posted
    }

    /// Tells the thread to end.
    pub fn shut_down(&self) {
        lock(&self.state).shutdown = true;
        self.tell();
    }

    /// Waits for news and takes all of it.
    pub fn take(&self) -> TraversalMail {
        let mut mail = lock(&self.state);
        while !mail.is_news() {
            mail = self.news.wait(mail).unwrap_or_else(PoisonError::into_inner);
        }
        mail.collect()
    }

    /// Takes all there is, if that is anything.
    pub fn try_take(&self) -> Option<TraversalMail> {
        let mut mail = lock(&self.state);
        mail.is_news().then(|| mail.collect())
    }

    /// Ends once something has been posted since the last call that ended.
    pub async fn posted(&self) {
        self.told.notified().await;
    }

    fn tell(&self) {
        self.news.notify_one();
        self.told.notify_one();
    }
}

impl TraversalMail {
    const fn is_news(&self) -> bool {
        !self.events.is_empty()
            || self.attributes.is_some()
            || self.drawn.is_some()
            || self.is_changed
            || self.shutdown
    }

    fn collect(&mut self) -> Self {
        self.is_changed = false;
        Self {
            view: self.view,
            attributes: self.attributes.take(),
            settings: self.settings.clone(),
            generation: self.generation,
            drawn: self.drawn.take(),
            events: std::mem::take(&mut self.events),
            posted: self.posted,
            shutdown: self.shutdown,
            is_changed: false,
        }
    }
}

/// What the traversal wants loaded.
#[derive(Debug, Default)]
pub(super) struct Demand {
    /// Most important first.
    pub pieces: Vec<Piece>,
    /// Events that the traversal had read when it wrote this.
    pub seen: u64,
}

/// What the caller wants of the loader.
#[derive(Debug)]
pub(super) enum Change {
    /// Another cloud.
    Add { cloud: usize, number: usize, source: Source },
    /// One less.
    Remove { number: usize },
    /// Another try to open one, at once.
    Reopen { number: usize },
}

/// What the loader thread reads.
#[derive(Debug, Default)]
pub(super) struct LoaderInbox {
    state: Mutex<LoaderMail>,
    /// Stores one permit: a wake-up before the wait is not lost.
    news: tokio::sync::Notify,
}

/// The newest demand.
#[derive(Debug, Default)]
pub(super) struct LoaderMail {
    /// Replaces the one before.
    pub demand: Option<Demand>,
    /// Oldest first.
    pub changes: Vec<Change>,
    /// Whether to end.
    pub shutdown: bool,
}

impl LoaderInbox {
    /// Replaces the demand.
    pub fn set_demand(&self, demand: Demand) {
        lock(&self.state).demand = Some(demand);
        self.news.notify_one();
    }

    /// Posts a change.
    pub fn change(&self, change: Change) {
        lock(&self.state).changes.push(change);
        self.news.notify_one();
    }

    /// Tells the thread to end.
    pub fn shut_down(&self) {
        lock(&self.state).shutdown = true;
        self.news.notify_one();
    }

    /// Waits for news and takes all of it.
    pub async fn take(&self) -> LoaderMail {
        loop {
            {
                let mut mail = lock(&self.state);
                if mail.demand.is_some() || !mail.changes.is_empty() || mail.shutdown {
                    return std::mem::take(&mut *mail);
                }
            }
            self.news.notified().await;
        }
    }
}

/// A thread that panicked while it held a lock leaves whole values behind: every change is a move.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
