"""What a valid signature says, and what it does not."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

MINUTE = "%Y-%m-%d %H:%M"
"""Form of a time in texts, in UTC."""


_UNCHANGED = (
    "Shown: the content of the file is as it was when it was signed with the key of this "
    "certificate."
)
_ALONE = (
    "Not shown: who holds this key. The certificate came with the file, and anybody can make one "
    "with any name. Give --ca with the laboratory's certificate, or with that of the authority "
    "that issued it, or compare the SHA-256 with the laboratory."
)
_VOUCHED = (
    "Shown: a certificate in {} vouches for this one.\nNot shown: that it was not revoked, and "
    "the time of signing. No list of revocations and no time stamp was asked for."
)


@dataclass(frozen=True, repr=False)
class Signature:
    """A signature that is valid; `str` has it in words.

    Attributes
    ----------
    subject, issuer : str
        Of the signer's certificate.
    fingerprint : str
        SHA-256 of the signer's certificate, hexadecimal.
    method : str
        Of the signature.
    signed : datetime
        When, as the signer's computer said.
    valid_from, valid_to : datetime
        Of the signer's certificate.
    trusted_by : str
        File of the user that vouches for the certificate; "" for none.
    """

    subject: str
    issuer: str
    fingerprint: str
    method: str
    signed: datetime
    valid_from: datetime
    valid_to: datetime
    trusted_by: str

    def __str__(self) -> str:
        expired = " (expired since)" if self.valid_to < datetime.now(UTC) else ""
        valid = f"valid {self.valid_from:{MINUTE}} to {self.valid_to:{MINUTE}} UTC{expired}"
        return "\n".join(
            [
                f"signed by    {self.subject}",
                f"on           {self.signed:{MINUTE}} UTC, as the signer's computer said",
                f"certificate  of {self.issuer}",
                f"             {valid}",
                f"             SHA-256 {self.fingerprint}",
                f"method       {self.method}",
                "",
                _UNCHANGED,
                _VOUCHED.format(self.trusted_by) if self.trusted_by else _ALONE,
            ]
        )

    __repr__ = __str__
