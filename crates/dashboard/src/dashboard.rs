//! The dashboard as a session sees it.

use crate::choice::Offered;
use crate::command::Demand;
use crate::feed::Feed;
use crate::limits::Limits;
use crate::operator_role::OperatorRole;
use crate::scene::{Scene, Setup};
use crate::server::serve;
use crate::server_state::ServerState;
use crate::token::Token;
use crate::viewers::Viewers;
use hydroboom_description::BuildError;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::session::FaultData;
use serde_json::Value;
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use thiserror::Error;

/// Why there is no dashboard.
#[derive(Debug, Error)]
pub enum DashboardError {
    /// The address is taken, or is none of this computer.
    #[error("{address} cannot be listened on: {error}")]
    Address {
        /// What was asked for.
        address: SocketAddr,
        /// What the system says.
        error: std::io::Error,
    },
    /// Others could reach it, and nobody said that they may.
    #[error(
        "{0} can be reached from other computers, and what goes there is not encrypted: allow it with \
         --allow-remote, or listen on 127.0.0.1"
    )]
    Remote(SocketAddr),
    /// The system has no chance numbers for the token.
    #[error("no token: {0}")]
    Token(getrandom::Error),
    /// The crane cannot be drawn.
    #[error(transparent)]
    Crane(#[from] BuildError),
    /// The system refuses a thread, or what it needs.
    #[error("the dashboard's thread: {0}")]
    Thread(std::io::Error),
}

/// A page that is served, and the people on it.
pub struct Dashboard {
    state: Arc<ServerState>,
    demands: Receiver<Demand>,
    address: String,
}

impl Dashboard {
    /// Serves the page from now on, until the program ends. Other computers are let in only where
    /// `allow_remote` says so.
    ///
    /// # Errors
    ///
    /// [`DashboardError`] when it cannot be served.
    pub fn open(
        listen: SocketAddr,
        allow_remote: bool,
        setup: &Setup<'_>,
        desk: Arc<Desk>,
    ) -> Result<Self, DashboardError> {
        if !listen.ip().is_loopback() && !allow_remote {
            return Err(DashboardError::Remote(listen));
        }
        let taken = |error| DashboardError::Address { address: listen, error };
        let listener = TcpListener::bind(listen).map_err(taken)?;
        listener.set_nonblocking(true).map_err(taken)?;
        let bound = listener.local_addr().map_err(taken)?;
        let token = Token::new().map_err(DashboardError::Token)?;
        // after the hash it is sent to nobody, and stands in no server's log
        let address = format!("http://{bound}/#{}", token.text());
        let (sender, demands) = channel();
        let limits = Limits::default();
        let state = Arc::new(ServerState {
            feed: Mutex::new(Feed::new(setup.first.clone())),
            scene: Scene::new(setup)?,
            offered: Offered {
                scenarios: setup.scenarios.clone(),
                speeds_mm_s: setup.speeds_mm_s.clone(),
            },
            role: OperatorRole::new(Arc::clone(&desk)),
            desk,
            token,
            demands: sender,
            bound,
            viewers: Viewers::new(&limits),
            limits,
        });
        let served = Arc::clone(&state);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(DashboardError::Thread)?;
        thread::Builder::new()
            .name("dashboard".into())
            .spawn(move || {
                if let Err(error) = runtime.block_on(serve(listener, served)) {
                    eprintln!("the dashboard ends here: {error}");
                }
            })
            .map_err(DashboardError::Thread)?;
        Ok(Self { state, demands, address })
    }

    /// Where it is, with the token.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Shows a record.
    pub fn see(&mut self, record: &Record) {
        self.feed().see(record);
    }

    /// What has been asked for since it was looked at last.
    pub fn demands(&mut self) -> Vec<Demand> {
        self.demands.try_iter().collect()
    }

    /// Says something to all.
    pub fn say(&mut self, text: &str) {
        self.feed().say(text);
    }

    /// Shows what a course came to: an object with course, strategy, rms_true_mm, rms_measured_mm, peak_true_mm, peak_measured_mm and fault.
    pub fn result(&mut self, result: &Value) {
        self.feed().result(result);
    }

    /// Shows a fault, and offers its last second.
    pub fn alarm(&mut self, fault: &FaultData) {
        self.feed().alarm(fault);
    }

    /// Offers a report, a page of its own.
    pub fn set_report(&mut self, page: String) {
        self.feed().report = Some(page);
    }

    fn feed(&self) -> MutexGuard<'_, Feed> {
        self.state.feed()
    }
}
