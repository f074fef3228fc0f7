//! The configuration of Zenoh: QUIC with certificates of both ends, access by key, nothing else.

use std::path::Path;

use serde_json::{Value, json};
use zenoh::{Config, Session, Wait};

use crate::NetworkError;
use crate::keys::{Access, AccessList, PersonalKey};
use crate::names::{self, COMMANDS, FROM, STATES, Source, What};
use crate::warnings::{self, NOT_LET_IN};

/// Silence after which Zenoh gives up a connection, ms. A session ends long before.
const LEASE_MS: u64 = 4000;
/// Time to connect, ms.
const OPEN_TIMEOUT_MS: u64 = 5000;
/// Connections at the same time: more than there are sessions, so that the next one gets the reason
/// why it has to wait.
const CONNECTIONS: usize = 16;
/// Longest message, bytes: the longest reply has less than half of it.
const LONGEST: usize = 16_384;

/// The endpoint of an address. One QUIC connection carries both kinds of messages: streams of the
/// robot in datagrams that are never sent again, requests in QUIC streams.
fn endpoint(address: &str) -> String {
    format!("quic/{address}?mixed_rel=1")
}

fn common(mode: &str) -> Value {
    json!({
        "mode": mode,
        "scouting": {
            "delay": 0,
            "multicast": { "enabled": false },
            "gossip": { "enabled": false },
        },
        "timestamping": { "enabled": false },
        "adminspace": { "enabled": false },
        "transport": {
            "unicast": {
                "open_timeout": OPEN_TIMEOUT_MS,
                "accept_timeout": OPEN_TIMEOUT_MS,
                "max_sessions": CONNECTIONS,
            },
            "link": {
                "protocols": ["quic"],
                "tx": { "lease": LEASE_MS },
                "rx": { "max_message_size": LONGEST },
            },
        },
    })
}

/// Opens the end beside the controller.
///
/// # Errors
///
/// When a file of the keys is missing, or the address cannot be used.
pub(crate) fn listen(
    address: &str,
    keys: &Path,
    access: &AccessList,
    commands: bool,
) -> Result<Session, NetworkError> {
    let mut config = common("router");
    config["listen"] = json!({ "endpoints": [endpoint(address)] });
    config["transport"]["link"]["tls"] = json!({
        "root_ca_certificate": keys.join("authority.pem"),
        "listen_private_key": keys.join("server.key"),
        "listen_certificate": keys.join("server.pem"),
        "enable_mtls": true,
        "close_link_on_expiration": true,
    });
    config["access_control"] = access_control(access, commands);
    open("listen at", address, &config)
}

/// Calls the end beside the controller.
///
/// # Errors
///
/// When it does not answer, or one end does not accept the certificate of the other.
pub(crate) fn connect(address: &str, key: &PersonalKey) -> Result<Session, NetworkError> {
    let mut config = common("client");
    config["connect"] = json!({
        "endpoints": [endpoint(address)],
        // One attempt, so that its reason is reported.
        "timeout_ms": 0,
        "exit_on_failure": true,
    });
    config["transport"]["link"]["tls"] = json!({
        "root_ca_certificate": key.authority(),
        "connect_private_key": key.secret(),
        "connect_certificate": key.certificate(),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    });
    open("reach", address, &config).map_err(|error| match error {
        NetworkError::Link { action, address, reason } => {
            NetworkError::Link { action, address, reason: not_reached(reason) }
        }
        other => other,
    })
}

/// Why the end beside the controller is not reached, as far as it can be known here.
fn not_reached(reason: String) -> String {
    if reason.contains("invalid peer certificate") {
        return "its certificate is not of the authority of this key: the key is of another robot"
            .to_owned();
    }
    if reason.contains("connection lost") {
        return "it ended the connection at once: it does not accept this key (of another robot, or \
                expired), and says why itself"
            .to_owned();
    }
    if reason.contains("Timeout") || reason.contains("timed out") {
        return "no answer: nobody listens there, or the network drops it".to_owned();
    }
    reason
}

fn open(action: &'static str, address: &str, config: &Value) -> Result<Session, NetworkError> {
    warnings::collect();
    drop(warnings::take());
    let failed = |error: zenoh::Error| NetworkError::Link {
        action,
        address: address.to_owned(),
        // What Zenoh returns says that it failed, the first warning says why.
        reason: { warnings::take().into_iter() }
            .find(|warning| !warning.starts_with(NOT_LET_IN))
            .unwrap_or_else(|| error.to_string()),
    };
    let config = Config::from_json5(&config.to_string()).map_err(failed)?;
    zenoh::open(config).wait().map_err(failed)
}

/// Everything is denied but what a key may do. The common name of its certificate is its id.
fn access_control(access: &AccessList, commands: bool) -> Value {
    let mut rules = vec![
        rule("watch", "ingress", &["query"], &[STATES.to_owned()]),
        rule("show", "egress", &["reply"], &[STATES.to_owned()]),
        rule(
            "offer",
            "egress",
            &["declare_subscriber", "declare_queryable"],
            &["i2ris/**".to_owned()],
        ),
    ];
    let (mut subjects, mut policies) = (Vec::new(), Vec::new());
    for entry in &access.key {
        let id = &entry.id;
        let own = [format!("{FROM}/{id}/**")];
        // A revoked key may still ask, and gets the reason.
        let [ask, answer, command, follow, tell] =
            ["ask", "answer", "command", "follow", "tell"].map(|it| format!("{it} {id}"));
        rules.push(rule(&ask, "ingress", &["query"], &own));
        rules.push(rule(&answer, "egress", &["reply"], &own));
        let mut allowed = vec![ask, answer, "offer".to_owned()];
        if let Some(may) = access.access(id) {
            let streams = [names::to(id, "**")];
            rules.push(rule(&follow, "ingress", &["declare_subscriber"], &streams));
            rules.push(rule(&tell, "egress", &["put"], &streams));
            allowed.extend(["watch".to_owned(), "show".to_owned(), follow, tell]);
            if commands && may == Access::Command {
                let keys = COMMANDS.map(|stream| command_of_any_session(id, What::Command(stream)));
                rules.push(rule(&command, "ingress", &["put"], &keys));
                allowed.push(command);
            }
        }
        subjects.push(json!({ "id": id, "cert_common_names": [id] }));
        policies.push(json!({ "rules": allowed, "subjects": [id] }));
    }
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}

fn command_of_any_session(id: &str, what: What) -> String {
    let source = Source { id, session: 0, what };
    source.key().replace("/0000000000000000/", "/*/")
}

fn rule(id: &str, flow: &str, messages: &[&str], keys: &[String]) -> Value {
    json!({
        "id": id,
        "permission": "allow",
        "flows": [flow],
        "messages": messages,
        "key_exprs": keys,
    })
}
