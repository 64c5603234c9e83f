//! Connections that are no viewers' yet: how many are open, and for how long.
//!
//! A connection carries one request: answers say that it is closed then. It is closed when the request's header
//! is not there in time, when the answer is not taken in time, and when it is the oldest and a new one comes while
//! all places are taken: whoever holds connections open and asks for nothing shuts nobody out.

use crate::limits::Limits;
use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;

/// After a connection could not be accepted, time until the next try: the system is short of descriptors.
const PAUSE: Duration = Duration::from_millis(10);

/// The open ones, in the order in which they came.
#[derive(Clone, Default)]
struct Open(Arc<Mutex<BTreeMap<u64, AbortHandle>>>);

impl Open {
    fn list(&self) -> MutexGuard<'_, BTreeMap<u64, AbortHandle>> {
        // a list is whole whatever happened to the thread that had it
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close_oldest(&self) {
        if let Some((_, connection)) = self.list().pop_first() {
            connection.abort();
        }
    }
}

/// Takes a connection off the list when it ends.
struct Listed {
    open: Open,
    number: u64,
}

impl Drop for Listed {
    fn drop(&mut self) {
        self.open.list().remove(&self.number);
    }
}

/// Accepts connections and lets a router answer them, for good.
pub(crate) async fn accept(listener: TcpListener, router: Router, limits: &Limits) {
    let open = Open::default();
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.header)
        .max_buf_size(limits.header_bytes);
    let mut number = 0;
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                number += 1;
                while open.list().len() >= limits.connections {
                    open.close_oldest();
                }
                let served = serve(&http, stream, router.clone(), limits.exchange);
                let listed = Listed { open: open.clone(), number };
                let mut list = open.list();
                let task = tokio::spawn(async move {
                    let _listed = listed;
                    served.await;
                });
                list.insert(number, task.abort_handle());
            }
            Err(_) => {
                open.close_oldest();
                tokio::time::sleep(PAUSE).await;
            }
        }
        // however many come, each is looked at before others take its place
        tokio::task::yield_now().await;
    }
}

/// One connection, until it ends or is a viewer's.
fn serve(
    http: &http1::Builder,
    stream: TcpStream,
    router: Router,
    within: Duration,
) -> impl Future<Output = ()> + Send + 'static {
    // an emergency stop waits for no other bytes; where the system cannot grant that it comes later
    let _ = stream.set_nodelay(true);
    let service = TowerToHyperService::new(router);
    let connection = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
    async move {
        // who breaks off or is too slow is told nothing, and nobody else has to be
        let _ = tokio::time::timeout(within, connection).await;
    }
}
