"""The certificate as a schema.org Dataset with Dublin Core terms, for catalogues of research data."""

from service.press.sheet import Node

_FORMS = {"certificate.json": "application/json", "certificate.pdf": "application/pdf"}


def describe_dataset(certificate: Node, *, address: str, validity: Node) -> Node:
    """Return a certificate as JSON-LD that needs no context from elsewhere.

    ``address`` : of the version, where its certificate is. ``validity`` : of the version, as it stands now
    """
    laboratory, item = certificate["laboratory"], certificate["item"]
    maker = {"@type": "Organization", **laboratory}
    published = certificate["published"][:1]
    described = {
        "@context": {"@vocab": "https://schema.org/", "dcterms": "http://purl.org/dc/terms/"},
        "@id": address,
        "@type": "Dataset",
        "identifier": [certificate["number"], f"sha256:{certificate['content_sha256']}"],
        "name": f"{certificate['title']} {certificate['number']}",
        "description": f"{certificate['procedure']}. {certificate['equation']}.",
        "version": str(certificate["version"]),
        "creativeWorkStatus": validity["state"],
        "creator": maker,
        "dcterms:creator": laboratory["name"],
        "dateCreated": certificate["created_at"],
        "dcterms:created": certificate["created_at"],
        "measurementTechnique": certificate["method"],
        "about": {
            "@type": "Product",
            "manufacturer": item["make"],
            "model": item["model"],
            "serialNumber": item["serial"],
        },
        "variableMeasured": [_describe(row) for row in certificate["coefficients"]],
        "distribution": [
            {"@type": "DataDownload", "contentUrl": f"{address}/{name}", "encodingFormat": kind}
            for name, kind in _FORMS.items()
        ],
    }
    if published:
        described |= {"publisher": maker, "datePublished": published[0]["at"]}
        described["dcterms:issued"] = published[0]["at"]
    if "valid_from" in validity:
        described["dcterms:valid"] = f"{validity['valid_from']}/{validity.get('valid_to', '..')}"
    return described


def _describe(row: Node) -> Node:
    said = {name: row[name] for name in ("iso", "f_number", "band", "channel") if name in row}
    uncertainty = {
        "@type": "PropertyValue",
        "name": "standard uncertainty",
        "value": row["standard_uncertainty"],
    }
    return {
        "@type": "PropertyValue",
        "name": row["name"],
        "value": row["value"],
        "unitText": row["unit"],
        "valueReference": [
            uncertainty,
            *({"@type": "PropertyValue", "name": name, "value": value} for name, value in said.items()),
        ],
    }
