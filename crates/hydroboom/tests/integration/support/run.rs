//! Run with a dashboard.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// Longest waiting time of a test.
pub const PATIENCE: Duration = Duration::from_secs(60);

const ARGUMENTS: [&str; 4] = ["run", "--dashboard", "127.0.0.1:0", "--simulated-time"];

/// Process with a dashboard on a port of its own, ended when dropped.
pub struct Run {
    process: Child,
    /// Host and port.
    pub host: String,
    /// Token for commands.
    pub token: String,
    /// Text on standard error.
    pub printed: Arc<Mutex<String>>,
}

impl Run {
    /// Starts `hydroboom run --dashboard` in simulated time at the rate of the clock. No deadline is missed
    /// on a busy computer.
    pub fn start() -> Self {
        Self::start_with(&[])
    }

    /// The same with further arguments.
    pub fn start_with(arguments: &[&str]) -> Self {
        Self::from(Command::new(env!("CARGO_BIN_EXE_hydroboom")).args(ARGUMENTS).args(arguments))
    }

    /// The same with a limited number of file descriptors.
    pub fn start_with_descriptors(most: u32) -> Self {
        let limited = format!("ulimit -n {most} && exec \"$0\" \"$@\"");
        let program = env!("CARGO_BIN_EXE_hydroboom");
        Self::from(Command::new("sh").args(["-c", &limited, program]).args(ARGUMENTS))
    }

    fn from(command: &mut Command) -> Self {
        let mut process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let line = lines.next().unwrap().unwrap();
        let rest = line.strip_prefix("dashboard: http://").expect("the address comes first");
        let (host, token) = rest.split_once("/#").unwrap();
        let (host, token) = (host.to_string(), token.to_string());
        let printed = Arc::new(Mutex::new(String::new()));
        let heard = Arc::clone(&printed);
        std::thread::spawn(move || {
            lines.map_while(Result::ok).for_each(|line| *heard.lock().unwrap() += &(line + "\n"));
        });
        Self { process, host, token, printed }
    }

    /// Address of the page with the token.
    pub fn address(&self) -> String {
        format!("http://{}/#{}", self.host, self.token)
    }

    /// Number of open file descriptors of the process.
    pub fn descriptors(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.process.id())).unwrap().count()
    }

    /// Viewer with an origin header, or the reason of a refusal.
    pub fn viewer_from(&self, origin: Option<&str>) -> Result<Viewer, String> {
        let mut request = format!("ws://{}/live", self.host).into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", origin.parse().unwrap());
        }
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(request, stream).map_err(|e| e.to_string())?;
        let mut viewer = Viewer { socket, number: 0, token: self.token.clone() };
        let setup = viewer.wait_for(|m| m["type"] == "setup");
        viewer.number = setup["viewer"].as_u64().unwrap();
        Ok(viewer)
    }

    /// Viewer without an origin header.
    pub fn viewer(&self) -> Viewer {
        self.viewer_from(None).unwrap()
    }

    /// Response to a GET request: status line with headers, and body.
    pub fn get(&self, path: &str, headers: &str) -> (String, String) {
        use std::io::{Read, Write};
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let host = if headers.contains("Host:") { "" } else { &format!("Host: {}\r\n", self.host) };
        write!(stream, "GET {path} HTTP/1.1\r\n{host}{headers}Connection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.into(), body.into())
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// WebSocket connection, as of a page.
pub struct Viewer {
    pub socket: WebSocket<TcpStream>,
    /// Number assigned by the program.
    pub number: u64,
    token: String,
}

impl Viewer {
    /// Sends a command with the token.
    pub fn command(&mut self, command: &str, rest: Value) {
        let mut message = json!({ "command": command });
        if command != "alive" {
            message["token"] = json!(self.token);
        }
        for (key, value) in rest.as_object().into_iter().flatten() {
            message[key] = value.clone();
        }
        self.send(&message.to_string());
    }

    /// Sends a text.
    pub fn send(&mut self, text: &str) {
        self.socket.send(Message::text(text)).unwrap();
    }

    /// Next message; none after the end of the connection.
    pub fn next(&mut self) -> Option<Value> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return serde_json::from_str(&text).ok(),
                Ok(Message::Close(_)) | Err(_) => return None,
                Ok(_) => {}
            }
        }
    }

    /// Waits for a message, and sends life signs meanwhile.
    pub fn wait_for(&mut self, is_it: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        let mut alive = Instant::now();
        while begun.elapsed() < PATIENCE {
            let message = self.next().expect("the connection has ended");
            if is_it(&message) {
                return message;
            }
            if alive.elapsed() > Duration::from_millis(300) {
                alive = Instant::now();
                self.command("alive", Value::Null);
            }
        }
        panic!("it did not come");
    }

    /// Waits until the machine is in a state.
    pub fn wait_for_state(&mut self, state: &str) -> Value {
        self.wait_for(|m| m["type"] == "frame" && m["state"] == state)
    }

    /// Takes the operator's role.
    pub fn operate(&mut self) {
        self.command("take-role", Value::Null);
        let number = self.number;
        self.wait_for(|m| m["type"] == "frame" && m["operator"] == number);
    }
}
