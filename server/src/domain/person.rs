//! People and what they may do. Pure: knows neither tokens nor where people are kept.

use super::refusal::Refusal;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a person may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// See everything, change nothing.
    Reader,
    /// Submit sweeps, and change their own.
    Contributor,
    /// Change everything, and say who the people are.
    Admin,
}

impl Role {
    /// All roles, from the one that may least.
    pub const ALL: [Role; 3] = [Self::Reader, Self::Contributor, Self::Admin];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reader => "reader",
            Self::Contributor => "contributor",
            Self::Admin => "admin",
        }
    }

    /// The role of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.name() == name)
    }
}

/// Who acts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Actor {
    /// Name of the person; `local` where there are no people, `operator` for commands on the service's own
    /// machine.
    pub name: String,
    /// What they may do.
    pub role: Role,
}

/// Who acts where there are no people: whoever reaches the service.
const LOCAL: &str = "local";
/// Who acts by commands on the machine of the data directory.
const OPERATOR: &str = "operator";
/// What empties the trash.
pub const JANITOR: &str = "janitor";
/// Longest name of a person.
const NAME_CHARACTERS: usize = 64;

/// What somebody may not do, as a sentence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Forbidden(pub String);

impl Actor {
    /// Whoever reaches a service that has no people.
    pub fn local() -> Self {
        Self { name: LOCAL.into(), role: Role::Admin }
    }

    /// Whoever may write in the data directory.
    pub fn operator() -> Self {
        Self { name: OPERATOR.into(), role: Role::Admin }
    }

    /// Whether they may submit.
    pub fn may_submit(&self) -> Result<(), Forbidden> {
        self.at_least(Role::Contributor, "submit sweeps")
    }

    /// Whether they may change a sweep with this owner: stop, delete, edit, seal it.
    pub fn may_change(&self, owner: Option<&str>) -> Result<(), Forbidden> {
        self.at_least(Role::Contributor, "change sweeps")?;
        if self.role == Role::Admin || owner == Some(self.name.as_str()) {
            return Ok(());
        }
        let whose = owner.map_or_else(|| "has no owner".into(), |o| format!("is {o}'s"));
        Err(Forbidden(format!("this sweep {whose}: only its owner and an admin may change it")))
    }

    /// Whether they may do what only admins may.
    pub fn may_manage(&self) -> Result<(), Forbidden> {
        self.at_least(Role::Admin, "do this")
    }

    fn at_least(&self, role: Role, what: &str) -> Result<(), Forbidden> {
        if self.role >= role {
            return Ok(());
        }
        let (name, has, needs) = (&self.name, self.role.name(), role.name());
        Err(Forbidden(format!("{name} is a {has} and may not {what}: it needs the role {needs}")))
    }
}

/// Whether a name can be a person's: letters, digits and `.-_@`, and nobody's who always acts.
pub fn check_name(name: &str) -> Result<(), Refusal> {
    let permitted = format!(
        "from 1 to {NAME_CHARACTERS} letters, digits, `.`, `-`, `_` and `@`, not signs alone, and not `{LOCAL}`, `{OPERATOR}` or `{JANITOR}`"
    );
    let fits = (1..=NAME_CHARACTERS).contains(&name.chars().count())
        && name.chars().all(|c| c.is_alphanumeric() || ".-_@".contains(c));
    let is_taken =
        [LOCAL, OPERATOR, JANITOR].iter().any(|always| name.eq_ignore_ascii_case(always));
    // `.` and `..` are no members of a path.
    if fits && !is_taken && name.chars().any(char::is_alphanumeric) {
        Ok(())
    } else {
        Err(Refusal::value("name", name, permitted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actor(name: &str, role: Role) -> Actor {
        Actor { name: name.into(), role }
    }

    #[test]
    fn owners_and_admins_may_change_a_sweep_and_nobody_else() {
        let ada = Some("ada");
        assert!(actor("ada", Role::Contributor).may_change(ada).is_ok());
        assert!(actor("bo", Role::Admin).may_change(ada).is_ok());
        assert!(actor("bo", Role::Admin).may_change(None).is_ok());
        for (who, owner) in [
            (actor("bo", Role::Contributor), ada),
            (actor("bo", Role::Contributor), None),
            // An owner whose role was taken.
            (actor("ada", Role::Reader), ada),
        ] {
            assert!(who.may_change(owner).is_err(), "{who:?}");
        }
    }

    #[test]
    fn readers_submit_nothing_and_contributors_manage_nobody() {
        assert!(actor("ada", Role::Reader).may_submit().is_err());
        assert!(actor("ada", Role::Contributor).may_submit().is_ok());
        assert!(actor("ada", Role::Contributor).may_manage().is_err());
        assert!(Actor::operator().may_manage().is_ok());
    }

    #[test]
    fn names_are_short_and_plain_and_nobody_is_called_local() {
        for name in ["ada", "Jürgen.K", "a-b_c@lab"] {
            assert!(check_name(name).is_ok(), "{name}");
        }
        for name in
            ["", "local", "operator", "two words", "a\nb", "..", "Local", "x;--", &"a".repeat(65)]
        {
            assert!(check_name(name).is_err(), "{name}");
        }
    }
}
