"""What a method is given besides the site, checked: the survey is of the site, places of access points are on it."""

from __future__ import annotations

from wayfuse.core.errors import RadioMapError, UsageError
from wayfuse.maps.site import Site
from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey

__all__ = ["check_floors", "known_places", "needed_survey"]


def check_floors(site: Site, survey: Survey) -> None:
    """Refuse a survey whose floors are not the site's."""
    if survey.floors != site.floor_names:
        raise RadioMapError(
            f"the radio map has floors {', '.join(survey.floors)}, site {site.name} has {', '.join(site.floor_names)}",
            remedy="build the radio map with this site",
        )


def needed_survey(name: str, site: Site, survey: Survey | None) -> Survey:
    """The survey, for the method ``name``, which goes by fingerprints.

    Raises
    ------
    UsageError : there is none. RadioMapError : it is of another site.
    """
    if survey is None:
        raise UsageError(
            f"{name} goes by fingerprints, there is no survey",
            where="--radio-map",
            remedy="give --radio-map FILE",
        )
    check_floors(site, survey)
    return survey


def known_places(site: Site, survey: Survey | None, places: ApPlaces | None) -> ApPlaces:
    """The places given, else estimated from the survey.

    Raises
    ------
    UsageError : there is neither, or the places name floors that the site does not have.
    """
    if places is None and survey is None:
        raise UsageError(
            "no places of access points", where="--access-points",
            remedy="give --access-points FILE, or --radio-map to estimate them from",
        )  # fmt: skip
    if places is None and survey is not None:
        return estimate_places(survey)
    assert places is not None  # noqa: S101
    if len(places) and int(places.floor.max()) >= len(site.floors):
        raise UsageError(
            f"an access point is on floor {int(places.floor.max())}, site {site.name} has {len(site.floors)}",
            where="--access-points", remedy="give the places of this site",
        )  # fmt: skip
    return places
