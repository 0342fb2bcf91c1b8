"""The JSON of jobs, in and out."""

from __future__ import annotations

import base64
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints, field_validator

from gcvec.hex_color import HEX_COLOR
from gcvec.options import RANGES, Options
from service.errors import ProblemView
from worker.artifacts import EXPORTS, KINDS
from worker.job import Job, Status
from worker.webhooks import SECRET_PREFIX

EventName = Literal["job.started", "job.succeeded", "job.failed", "job.canceled"]
Name = Annotated[str, StringConstraints(max_length=1024)]
Color = Annotated[str, StringConstraints(pattern=f"^{HEX_COLOR}$")]


def whole(number: object) -> object:
    """JSON knows no difference between 5 and 5.0."""
    return int(number) if isinstance(number, float) and number.is_integer() else number


def number(option: str, description: str) -> Any:
    """The field of an option, with the engine's default and the range that it checks, which is told here."""
    least, most, ends = RANGES[option]
    bounds = ("minimum", "maximum") if ends else ("exclusiveMinimum", "exclusiveMaximum")
    told: dict[str, Any] = dict(zip(bounds, (least, most), strict=True))
    return Field(getattr(Options, option), description=description, json_schema_extra=told)


Count = Annotated[int, BeforeValidator(whole)]


class JobOptions(BaseModel):
    """The options of one vectorization: those of the command line."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)

    strategy: Literal["batch", "paper"] = Field(
        Options.strategy,
        description="how interior control points are placed: batch is fast, paper as published",
    )
    target_mse: float = number("target_mse", "mean squared error (0-255 scale) at which refinement stops")
    max_points: Count = number("max_points", "most interior control points of one region; 0: no limit")
    workers: Count = number("workers", "threads; 0: as many as the server grants")
    regions: Count = number("regions", "automatic regions wanted; 0: the picture decides")
    snap: float = number("snap", "pixels that annotated borders may move onto edges; 0: only made smooth")
    effort: Count = number("effort", "time to spend on a smaller file")
    target_bytes: Count = number(
        "target_bytes", "largest file; the error is as small as it allows; 0: target_mse decides"
    )
    image_name: Name | None = Field(
        None, description="the picture's name in an annotation file of several; default: its file name"
    )

    matte: Color | None = Field(
        None,
        description="what transparent pixels are laid over, #rrggbb; default: the server's setting, white",
    )

    def to_engine(self) -> Options:
        """The engine's options. Raises gcvec.InputError naming the option that is out of range."""
        return Options(**self.model_dump(exclude={"image_name", "matte"}))


class Webhook(BaseModel):
    """An address that is called when the job changes, after the Standard Webhooks specification."""

    model_config = ConfigDict(extra="forbid")

    url: Annotated[str, StringConstraints(max_length=2048)] = Field(description="https://...")
    secret: Annotated[str, StringConstraints(max_length=128)] = Field(
        description="the key of the signatures: whsec_ and 24 to 64 random bytes in Base64"
    )
    events: list[EventName] = Field(
        default=["job.succeeded", "job.failed", "job.canceled"], description="what to tell", max_length=8
    )

    @field_validator("secret")
    @classmethod
    def _check(cls, secret: str) -> str:
        try:
            key = base64.b64decode(secret.removeprefix(SECRET_PREFIX), validate=True)
        except ValueError:
            key = b""
        if not secret.startswith(SECRET_PREFIX) or not 24 <= len(key) <= 64:
            raise ValueError("whsec_ and 24 to 64 bytes in Base64 are expected")
        return secret


class ProgressView(BaseModel):
    """How far a job is: one refinement iteration, or a phase before it."""

    phase: str
    region: int
    regions: int
    iteration: int
    points: int
    worst_error: float | None
    mse: float | None
    fraction: float


class JobView(BaseModel):
    """A job. `links` holds what can be asked for now."""

    id: str
    status: Status
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    expires_at: datetime | None
    progress: ProgressView | None
    error: ProblemView | None
    warnings: list[str]
    revisions: int = Field(description="how often the result has been edited")
    links: dict[str, str]

    @classmethod
    def of(cls, job: Job) -> JobView:
        return cls.model_validate(
            {
                "id": job.id,
                "status": job.status,
                "created_at": _moment(job.created_at),
                "started_at": _moment(job.started_at),
                "finished_at": _moment(job.finished_at),
                "expires_at": _moment(job.expires_at),
                "progress": job.progress,
                "error": job.error,
                "warnings": list(job.warnings),
                "revisions": job.revisions,
                "links": _links(job),
            }
        )


class JobPage(BaseModel):
    """Some of the caller's jobs, newest first; `next` is the link to older ones."""

    jobs: list[JobView]
    next: str | None


def json_of(model: type[BaseModel]) -> dict[str, Any]:
    """What the interface description says of a form field that holds a model as JSON text."""
    return {"contentMediaType": "application/json", "contentSchema": model.model_json_schema()}


def job_path(job_id: str) -> str:
    return f"/v1/jobs/{job_id}"


def _links(job: Job) -> dict[str, str]:
    base = job_path(job.id)
    links = {"self": base, "events": f"{base}/events"}
    if job.status != "canceled":
        links["image"] = f"{base}/image"
    if job.status == "succeeded":
        links |= {name: f"{base}/{kind.route}" for name, kind in (KINDS | EXPORTS).items()}
        links["edits"] = f"{base}/edits"
    return links


def _moment(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC)
