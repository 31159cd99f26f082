"""Headings in German, French, Spanish and Italian: the field's words in English.

>>> english("Soll-Geschwindigkeit"), english("Motorstrom"), english("température")
('setpoint-speed', 'current', 'temperature')
>>> english("Istdrehzahl Achse 3"), english("Lagesollwert"), english("q_2")
('actual speed joint 3', 'setpoint position', 'q_2')
>>> english("Ventilstellung V7"), english("Zulauf")
('valve position V7', 'inflow')
"""

from __future__ import annotations

import re
import unicodedata

ABROAD = {
    "speed": "geschwindigkeit drehzahl vitesse velocidad velocita",
    "position": "lage weg stellung posicion posizione",
    "angle": "winkel angulo angolo",
    "acceleration": "beschleunigung aceleracion accelerazione",
    "torque": "drehmoment couple coppia",
    "force": "kraft fuerza forza",
    "current": "strom courant corriente corrente",
    "voltage": "spannung voltaje tensione",
    "temperature": "temperatur temperatura",
    "heater": "heizung heizer heizelement heizleistung heizstab chauffage calefactor riscaldatore",
    "ambient": "umgebung raum aussen ambiente exterieur",
    "pump": "pumpe pompe bomba pompa",
    "valve": "ventil vanne valvula valvola",
    "level": "fullstand fuellstand pegel niveau nivel livello",
    "flow": "durchfluss volumenstrom foerderstrom debit caudal portata",
    "inflow": "zulauf zufluss afflux afflusso",
    "outflow": "ablauf abfluss ablass auslauf deflusso",
    "inlet": "eintritt einlass eingang entree entrada ingresso",
    "outlet": "austritt auslass sortie salida uscita",
    "return": "rucklauf ruecklauf",
    "supply": "vorlauf",
    "sun": "sonne sonneneinstrahlung einstrahlung soleil sol sole",
    "load": "last beladung charge carga carico",
    "pressure": "druck foerderdruck enddruck pression presion pressione",
    "power": "leistung puissance potencia potenza",
    "distance": "abstand strecke",
    "heading": "kurs rumbo",
    "steering": "lenkung lenkwinkel braquage direccion sterzo",
    "setpoint": "soll sollwert consigne consigna",
    "actual": "ist istwert mesure medido misurato",
    "joint": "achse gelenk articulacion giunto",
    "left": "links gauche izquierda sinistra",
    "right": "rechts droite derecha destra",
}
"""The word of the field → words for it, without accents."""
_ENGLISH = {word: name for name, several in ABROAD.items() for word in several.split()}
_PARTS = ("ventil", "pumpe")
"""Of what a compound tells something."""
_COMPOUND = re.compile(
    "(soll|ist|raum|umgebungs|aussen)?[a-z]*?(geschwindigkeit|drehzahl|position|stellung|winkel|beschleunigung"
    "|drehmoment|moment|kraft|strom|spannung|temperatur|lage(?=soll|ist))(?:s|en)?(soll|ist)?(?:wert)?"
)
"""German writes words together: what a thing is stands last, whether it is told stands first, or
behind it (``Stromistwert``)."""


def english(name: str) -> str:
    """A heading with the words that are known said in English; others stay."""
    plain = (
        unicodedata.normalize("NFKD", name.replace("ß", "ss")).encode("ascii", "ignore").decode()
    )
    return re.sub(r"[A-Za-z]+", lambda found: _said(found[0]), plain)


def _said(word: str) -> str:
    known = word.lower()
    if known in _ENGLISH:
        return _ENGLISH[known]
    compound = _COMPOUND.fullmatch(known)
    if compound is None:
        return word
    said = _ENGLISH.get(compound[2], compound[2])
    first = (compound[1] or "").removesuffix("s") or compound[3]
    first = first or next((w for w in _PARTS if known.startswith(w)), "")
    return f"{_ENGLISH[first]} {said}" if first else said
