//! The dashboard's interface to a session.

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

/// Reason why the dashboard could not be started.
#[derive(Debug, Error)]
pub enum DashboardError {
    /// The address is in use, or does not belong to this computer.
    #[error("{address} cannot be listened on: {error}")]
    Address {
        /// Requested address.
        address: SocketAddr,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The address is reachable from other computers, which the caller has not allowed.
    #[error(
        "{0} can be reached from other computers, and what goes there is not encrypted: allow it with \
         --allow-remote, or listen on 127.0.0.1"
    )]
    Remote(SocketAddr),
    /// The system provides no random numbers for the token.
    #[error("no token: {0}")]
    Token(getrandom::Error),
    /// No geometry of the crane could be computed.
    #[error(transparent)]
    Crane(#[from] BuildError),
    /// The thread or its asynchronous runtime could not be created.
    #[error("the dashboard's thread: {0}")]
    Thread(std::io::Error),
}

/// Web page of a run, with charts, drawing and controls; it takes the commands of its viewers.
pub struct Dashboard {
    state: Arc<ServerState>,
    demands: Receiver<Demand>,
    address: String,
}

impl Dashboard {
    /// Starts the web server, which runs until the program ends. An address that other computers can reach is refused
    /// unless `allow_remote` is true.
    ///
    /// # Errors
    ///
    /// - [`DashboardError::Remote`] if other computers can reach the address and `allow_remote` is false.
    /// - [`DashboardError::Address`] if the address cannot be listened on.
    /// - [`DashboardError::Token`] without random numbers for the token.
    /// - [`DashboardError::Crane`] if the geometry of the crane cannot be computed.
    /// - [`DashboardError::Thread`] if the thread or its runtime cannot be created.
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
        // browsers do not send the part after the hash, so the token appears in no server's log
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

    /// Address of the page as a URL, including the access token.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Adds the record of a control period to the charts, which show every tenth one. A new viewer receives the last
    /// 3000 of these: thirty seconds at a period of 1 ms.
    pub fn see(&mut self, record: &Record) {
        self.feed().see(record);
    }

    /// Requests of the viewers since the last call, oldest first; empty without any. It does not wait.
    pub fn demands(&mut self) -> Vec<Demand> {
        self.demands.try_iter().collect()
    }

    /// Shows a notice, as plain text, to all viewers. The last 20 are kept for new viewers.
    pub fn say(&mut self, text: &str) {
        self.feed().say(text);
    }

    /// Shows the result of a course: an object with course, strategy, rms_true_mm, rms_measured_mm, peak_true_mm,
    /// peak_measured_mm and fault.
    pub fn result(&mut self, result: &Value) {
        self.feed().result(result);
    }

    /// Shows a fault, and offers the last second before it as a download in CSV, which replaces an earlier one.
    pub fn alarm(&mut self, fault: &FaultData) {
        self.feed().alarm(fault);
    }

    /// Offers the report of the last course, an HTML page of its own. It replaces an earlier one.
    pub fn set_report(&mut self, page: String) {
        self.feed().report = Some(page);
    }

    fn feed(&self) -> MutexGuard<'_, Feed> {
        self.state.feed()
    }
}
