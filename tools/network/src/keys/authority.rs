//! Makes certificates, on the computer of the robot.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::Write as _;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use i2ris::ipc::random_id;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use super::access::is_id;
use super::{Access, AccessList, KeyEntry, KeyError, wrong};

/// How long the authority and the server's certificate are valid. Who holds the folder of keys
/// holds the robot, so a shorter time would protect nothing.
const AUTHORITY_DAYS: i64 = 3650;
/// Clocks of two computers differ.
const CLOCK_TOLERANCE: Duration = Duration::hours(1);

/// How long a key is valid from now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lifetime(Duration);

impl Lifetime {
    #[must_use]
    pub fn days(days: u16) -> Self {
        Self(Duration::days(days.into()))
    }

    /// So many seconds; below 0, the key has expired when it is made.
    #[must_use]
    pub fn seconds(seconds: i32) -> Self {
        Self(Duration::seconds(seconds.into()))
    }
}

/// Makes a key for a person, and returns its folder. The first call makes the authority; `hosts`
/// are the addresses under which the server is called, and a call that names some makes a new
/// certificate of the server.
///
/// # Errors
///
/// When the name is none, the folder cannot be written, or the server has no certificate and no
/// host is named.
pub fn make_key(
    folder: &Path,
    name: &str,
    access: Access,
    hosts: &[String],
    lifetime: Lifetime,
) -> Result<PathBuf, KeyError> {
    if !is_id(name) || name.len() > 64 {
        return Err(wrong(folder)(format!(
            "`{name}` is no name of a key: letters, digits, `-` and `_`, 64 at most"
        )));
    }
    make_folder(folder)?;
    let _lock = lock(folder)?;
    let has_server = folder.join("server.pem").exists();
    if hosts.is_empty() && !has_server {
        return Err(wrong(folder)(
            "the server has no certificate yet; name the addresses of this computer: --host \
             192.168.1.10",
        ));
    }
    let authority = Authority::open(folder)?;
    if !hosts.is_empty() {
        authority.certify_server(hosts)?;
    }
    let id = format!("{name}-{:08x}", random_id() >> 32);
    let people = folder.join("people").join(&id);
    make_folder(&people)?;
    let (certificate, key) = authority.certify(
        CertificateParams::default(),
        &id,
        ExtendedKeyUsagePurpose::ClientAuth,
        lifetime.0,
    )?;
    write_new(&people.join("ca.pem"), &authority.certificate)?;
    write_new(&people.join("certificate.pem"), &certificate)?;
    write_new(&people.join("key.pem"), &key)?;
    let mut list = match AccessList::file(folder).exists() {
        true => AccessList::load(folder)?,
        false => AccessList::default(),
    };
    list.key.push(KeyEntry { id, may: access, revoked: false });
    write_list(folder, &list)?;
    Ok(people)
}

/// Revokes a key by its id, or all keys of a person by name, and returns their ids.
///
/// # Errors
///
/// When there is none, or the list cannot be read or written.
pub fn revoke(folder: &Path, id_or_name: &str) -> Result<Vec<String>, KeyError> {
    let _lock = lock(folder)?;
    let mut list = AccessList::load(folder)?;
    let mut revoked = Vec::new();
    for entry in &mut list.key {
        let name = entry.id.rsplit_once('-').map(|(name, _)| name);
        let is_meant = entry.id == id_or_name || name == Some(id_or_name);
        if is_meant && !entry.revoked {
            entry.revoked = true;
            revoked.push(entry.id.clone());
        }
    }
    if revoked.is_empty() {
        return Err(wrong(&AccessList::file(folder))(format!(
            "no valid key `{id_or_name}` is in the list"
        )));
    }
    write_list(folder, &list)?;
    Ok(revoked)
}

struct Authority {
    folder: PathBuf,
    certificate: String,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// The authority of a folder, made if there is none yet.
    fn open(folder: &Path) -> Result<Self, KeyError> {
        let (certificate, key) = (folder.join("authority.pem"), folder.join("authority.key"));
        if !certificate.exists() {
            make_folder(folder)?;
            let mut params = CertificateParams::default();
            params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
            params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
            name_and_date(&mut params, "i2ris authority", Duration::days(AUTHORITY_DAYS));
            let pair = KeyPair::generate().map_err(wrong(&key))?;
            let signed = params.self_signed(&pair).map_err(wrong(&certificate))?;
            write_new(&key, &pair.serialize_pem())?;
            write_new(&certificate, &signed.pem())?;
        }
        let pem = fs::read_to_string(&certificate).map_err(wrong(&certificate))?;
        let pair = fs::read_to_string(&key).map_err(wrong(&key))?;
        let pair = KeyPair::from_pem(&pair).map_err(wrong(&key))?;
        let issuer = Issuer::from_ca_cert_pem(&pem, pair).map_err(wrong(&certificate))?;
        Ok(Self { folder: folder.to_owned(), certificate: pem, issuer })
    }

    fn certify_server(&self, hosts: &[String]) -> Result<(), KeyError> {
        let file = self.folder.join("server.pem");
        let params = CertificateParams::new(hosts).map_err(wrong(&file))?;
        let (certificate, key) = self.certify(
            params,
            "i2ris server",
            ExtendedKeyUsagePurpose::ServerAuth,
            Duration::days(AUTHORITY_DAYS),
        )?;
        replace(&self.folder.join("server.key"), &key)?;
        replace(&file, &certificate)
    }

    /// A certificate for one purpose only: a client's can never serve, nor a server's command.
    fn certify(
        &self,
        mut params: CertificateParams,
        name: &str,
        purpose: ExtendedKeyUsagePurpose,
        lifetime: Duration,
    ) -> Result<(String, String), KeyError> {
        params.extended_key_usages = vec![purpose];
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.use_authority_key_identifier_extension = true;
        name_and_date(&mut params, name, lifetime);
        let pair = KeyPair::generate().map_err(wrong(&self.folder))?;
        let signed = params.signed_by(&pair, &self.issuer);
        Ok((signed.map_err(wrong(&self.folder))?.pem(), pair.serialize_pem()))
    }
}

fn name_and_date(params: &mut CertificateParams, name: &str, lifetime: Duration) {
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    let now = OffsetDateTime::now_utc();
    params.not_before = now.min(now + lifetime) - CLOCK_TOLERANCE;
    params.not_after = now + lifetime;
}

/// The list is read, changed and written by one program at a time: a key that is made meanwhile would
/// bring back one that was revoked.
fn lock(folder: &Path) -> Result<File, KeyError> {
    let path = folder.join("lock");
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(false).mode(0o600);
    let file = options.open(&path).map_err(wrong(&path))?;
    file.lock().map_err(wrong(&path))?;
    Ok(file)
}

fn make_folder(path: &Path) -> Result<(), KeyError> {
    let mut builder = DirBuilder::new();
    builder.recursive(true).mode(0o700);
    builder.create(path).map_err(wrong(path))
}

/// Writes a file that only its owner can read and that does not exist yet.
fn write_new(path: &Path, text: &str) -> Result<(), KeyError> {
    let mut options = OpenOptions::new();
    let file = options.write(true).create_new(true).mode(0o600).open(path);
    let mut file = file.map_err(wrong(path))?;
    let written = file.write_all(text.as_bytes());
    written.and_then(|()| file.sync_all()).map_err(wrong(path))
}

/// Puts another file in the place of one, in one step: a server may be reading.
fn replace(path: &Path, text: &str) -> Result<(), KeyError> {
    let new = path.with_extension("new");
    let _ = fs::remove_file(&new);
    write_new(&new, text)?;
    fs::rename(&new, path).map_err(wrong(path))
}

fn write_list(folder: &Path, list: &AccessList) -> Result<(), KeyError> {
    let file = AccessList::file(folder);
    let text = toml::to_string(list).map_err(wrong(&file))?;
    let comment = "# Who may use the network: `i2ris bridge key`, `i2ris bridge revoke`.\n\n";
    replace(&file, &format!("{comment}{text}"))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use super::*;
    use crate::keys::PersonalKey;

    fn hosts() -> Vec<String> {
        vec!["127.0.0.1".to_owned()]
    }

    #[test]
    fn the_first_key_makes_the_authority_and_names_the_server() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("keys");
        let days = Lifetime::days(10);
        let error = make_key(&folder, "alice", Access::Command, &[], days).unwrap_err();
        assert!(error.to_string().contains("--host"), "{error}");
        let alice = make_key(&folder, "alice", Access::Command, &hosts(), days).unwrap();
        let authority = fs::read(folder.join("authority.pem")).unwrap();
        let bob = make_key(&folder, "bob", Access::Watch, &[], days).unwrap();
        assert_eq!(fs::read(folder.join("authority.pem")).unwrap(), authority);
        let (alice, bob) = (PersonalKey::load(&alice).unwrap(), PersonalKey::load(&bob).unwrap());
        assert!(alice.id().starts_with("alice-") && bob.id().starts_with("bob-"));
        let list = AccessList::load(&folder).unwrap();
        assert_eq!(list.access(alice.id()), Some(Access::Command));
        assert_eq!(list.access(bob.id()), Some(Access::Watch));
        for file in ["authority.key", "server.key"] {
            let mode = fs::metadata(folder.join(file)).unwrap().mode();
            assert_eq!(mode & 0o777, 0o600, "{file}");
        }
    }

    #[test]
    fn a_person_is_revoked_with_all_keys_and_a_new_one_is_another() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name| {
            let days = Lifetime::days(1);
            let made = make_key(folder.path(), name, Access::Command, &hosts(), days);
            PersonalKey::load(&made.unwrap()).unwrap().id().to_owned()
        };
        let (first, second, bob) = (make("alice"), make("alice"), make("bob"));
        assert_ne!(first, second);
        let revoked = revoke(folder.path(), "alice").unwrap();
        assert_eq!(revoked, [first, second]);
        let third = make("alice");
        let list = AccessList::load(folder.path()).unwrap();
        assert!(revoked.iter().all(|id| list.access(id).is_none()));
        assert!(list.access(&third).is_some() && list.access(&bob).is_some());
        assert_eq!(revoke(folder.path(), &bob).unwrap(), [bob]);
        assert!(revoke(folder.path(), "carol").is_err());
    }

    #[test]
    fn keys_that_are_made_and_revoked_at_the_same_time_do_not_undo_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            make_key(folder.path(), name, Access::Command, &[], Lifetime::days(1)).unwrap()
        };
        make_key(folder.path(), "first", Access::Watch, &hosts(), Lifetime::days(1)).unwrap();
        let names: Vec<String> = (0..10).map(|number| format!("person{number}")).collect();
        names.iter().for_each(|name| drop(make(name)));
        std::thread::scope(|scope| {
            scope.spawn(|| (0..20).for_each(|_| drop(make("other"))));
            scope.spawn(|| {
                names.iter().for_each(|name| drop(revoke(folder.path(), name).unwrap()));
            });
        });
        let list = AccessList::load(folder.path()).unwrap();
        assert_eq!(list.key.len(), 31);
        let revoked = list.key.iter().filter(|entry| entry.revoked);
        assert_eq!(revoked.count(), names.len(), "{list:?}");
    }

    #[test]
    fn a_name_that_could_leave_its_folder_is_none() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["", "../x", "a b", "a/b", "*"] {
            let days = Lifetime::days(1);
            let made = make_key(folder.path(), name, Access::Watch, &hosts(), days);
            assert!(made.unwrap_err().to_string().contains("no name"), "{name}");
        }
    }
}
