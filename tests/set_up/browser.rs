//! A browser without a screen, driven over its debugging pipe: Debian's Chromium, and nothing to install besides.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::prelude::BASE64_STANDARD as BASE64;
use serde_json::{Value, json};

/// How long the browser may take for anything it is told.
const PATIENCE: Duration = Duration::from_secs(30);

/// One page in a browser of its own, closed when it is dropped.
pub struct Browser {
    child: Child,
    pipe: ChildStdin,
    told: Receiver<Value>,
    session: Option<String>,
    calls: u64,
    /// What the browser held against the page, or the page asked of others.
    complaints: Vec<String>,
    origin: String,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Opens a page of `origin`, such as `http://127.0.0.1:8420/`.
    ///
    /// # Panics
    /// When the browser does not start.
    #[must_use]
    pub fn open(origin: &str) -> Self {
        let profile = tempfile::tempdir().expect("a folder for the browser");
        let data = format!("--user-data-dir={}", profile.path().display());
        // The pipe is at file descriptors 3 and 4, which only a shell can put it at.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", "chromium"])
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--no-first-run",
            ])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--remote-debugging-pipe", &data, "about:blank"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a shell");
        let pipe = child.stdin.take().expect("stdin is piped");
        let stdout = child.stdout.take().expect("stdout is piped");
        let (sender, told) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(stdout).split(0).map_while(Result::ok) {
                let message = serde_json::from_slice(&message).unwrap_or(Value::Null);
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        let (session, calls, complaints) = (None, 0, Vec::new());
        let origin = origin.to_owned();
        let mut browser = Self { child, pipe, told, session, calls, complaints, origin, _profile: profile };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attached =
            browser.call("Target.attachToTarget", json!({"targetId": target["targetId"], "flatten": true}));
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page.enable", "Runtime.enable", "Log.enable", "Network.enable"] {
            browser.call(domain, json!({}));
        }
        browser.call("Page.navigate", json!({"url": browser.origin}));
        browser
    }

    /// What an expression of JavaScript is in the page.
    ///
    /// # Panics
    /// When it throws.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let how = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let found = self.call("Runtime.evaluate", how);
        assert!(found["exceptionDetails"].is_null(), "{expression}: {found}");
        found["result"]["value"].clone()
    }

    /// Waits until an expression is true; says how long that took.
    ///
    /// # Panics
    /// When it does not become true within `patience`.
    #[track_caller]
    pub fn wait(&mut self, expression: &str, patience: Duration) -> Duration {
        let began = Instant::now();
        while self.evaluate(expression) != Value::Bool(true) {
            let text = || "document.body ? document.body.innerText : 'nothing'";
            if began.elapsed() > patience {
                panic!("not within {patience:?}: {expression}; the page says: {}", self.evaluate(text()));
            }
            std::thread::sleep(Duration::from_millis(25));
        }
        began.elapsed()
    }

    /// Presses the button that `selector` finds, as soon as it can be pressed.
    #[track_caller]
    pub fn press(&mut self, selector: &str) {
        let can = format!("(it => !!it && !it.disabled)(document.querySelector({}))", json!(selector));
        self.wait(&can, PATIENCE);
        self.evaluate(&format!("document.querySelector({}).click()", json!(selector)));
    }

    /// What the page looks like in a window of that size, by day or by night, as a PNG; the whole of it, however long it is.
    ///
    /// # Panics
    /// When the browser draws none.
    pub fn picture(&mut self, (width, height): (u32, u32), dark: bool) -> Vec<u8> {
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600});
        self.call("Emulation.setDeviceMetricsOverride", size);
        let scheme = json!([{"name": "prefers-color-scheme", "value": if dark { "dark" } else { "light" }}]);
        self.call("Emulation.setEmulatedMedia", json!({"features": scheme}));
        // Two frames later all of it stands where it will stay.
        self.evaluate(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))",
        );
        let whole = json!({"format": "png", "captureBeyondViewport": true});
        let drawn = self.call("Page.captureScreenshot", whole);
        BASE64.decode(drawn["data"].as_str().expect("a picture")).expect("base64")
    }

    /// Errors on the console, violations of the page's policy, dialogs, and requests to others, so far.
    pub fn complaints(&mut self) -> Vec<String> {
        // What was told before this answer is heard with it.
        self.evaluate("1");
        std::mem::take(&mut self.complaints)
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        self.calls += 1;
        let mut call = json!({"id": self.calls, "method": method, "params": params});
        if let Some(session) = &self.session {
            call["sessionId"] = json!(session);
        }
        self.pipe.write_all(format!("{call}\0").as_bytes()).expect("the browser runs");
        let deadline = Instant::now() + PATIENCE;
        loop {
            let message = match self.told.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(message) => message,
                Err(RecvTimeoutError::Timeout) => panic!("{method}: no answer within {PATIENCE:?}"),
                Err(RecvTimeoutError::Disconnected) => panic!("{method}: the browser has ended"),
            };
            if message["id"] == json!(self.calls) {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].clone();
            }
            self.note(&message);
        }
    }

    fn note(&mut self, event: &Value) {
        let params = &event["params"];
        let bad = match event["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" | "Page.javascriptDialogOpening" => true,
            "Runtime.consoleAPICalled" => params["type"] == "error" || params["type"] == "warning",
            "Log.entryAdded" => params["entry"]["level"] == "error",
            "Network.requestWillBeSent" => {
                let url = params["request"]["url"].as_str().unwrap_or_default();
                !url.starts_with(&self.origin) && !url.starts_with("blob:")
            }
            _ => false,
        };
        if bad {
            self.complaints.push(event.to_string());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It takes its own processes with it when it is asked to close; a moment later there is no asking.
        let close = json!({"id": u64::MAX >> 12, "method": "Browser.close"});
        let _ = self.pipe.write_all(format!("{close}\0").as_bytes());
        for _ in 0..40 {
            if matches!(self.child.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
