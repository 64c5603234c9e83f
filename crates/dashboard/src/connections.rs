//! Connections that are not yet upgraded to viewers: bounds on their number and duration.
//!
//! A connection carries one request; each answer announces that the connection is closed. The server closes it
//! when the header or the reading of the answer exceeds its time limit. When all places are taken, a new connection
//! replaces the oldest one. Idle connections can therefore never block new ones.

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

/// Pause after a failed `accept`: the system is out of descriptors \[duration\].
const PAUSE: Duration = Duration::from_millis(10);

/// Open connections, ordered by arrival.
#[derive(Clone, Default)]
struct Open(Arc<Mutex<BTreeMap<u64, AbortHandle>>>);

impl Open {
    fn list(&self) -> MutexGuard<'_, BTreeMap<u64, AbortHandle>> {
        // the map stays valid after a panic of another thread: it is only inserted into and removed from
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close_oldest(&self) {
        if let Some((_, connection)) = self.list().pop_first() {
            connection.abort();
        }
    }
}

/// Removes a connection from the map when it ends.
struct Listed {
    open: Open,
    number: u64,
}

impl Drop for Listed {
    fn drop(&mut self) {
        self.open.list().remove(&self.number);
    }
}

/// Accepts connections without end and hands each to the router.
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
        // lets each connection run once before the next arrivals can displace it
        tokio::task::yield_now().await;
    }
}

/// Serves one connection until it ends or is upgraded to a viewer.
fn serve(
    http: &http1::Builder,
    stream: TcpStream,
    router: Router,
    within: Duration,
) -> impl Future<Output = ()> + Send + 'static {
    // sends an emergency stop without waiting for a full packet; if the system refuses, it is only slower
    let _ = stream.set_nodelay(true);
    let service = TowerToHyperService::new(router);
    let connection = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
    async move {
        // a connection that breaks or times out gets no answer; other connections are not affected
        let _ = tokio::time::timeout(within, connection).await;
    }
}
