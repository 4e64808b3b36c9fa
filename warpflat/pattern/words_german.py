"""German words of printed patterns, by the English ones."""

from __future__ import annotations

__all__ = ["NAMES", "PHRASES"]

#: Names may be several words; the longest run that is here is replaced.
NAMES = {
    "front bodice": "Oberteil vorn",
    "back bodice": "Oberteil hinten",
    "front skirt": "Rock vorn",
    "back skirt": "Rock hinten",
    "front centre": "Vordere Mitte",
    "front side": "Seitenteil vorn",
    "back centre": "Hintere Mitte",
    "back side": "Seitenteil hinten",
    "centre front": "vordere Mitte",
    "centre back": "hintere Mitte",
    "neck facing": "Halsbeleg",
    "of neck facing": "des Halsbelegs",
    "of armhole facing": "des Armlochbelegs",
    "armhole facing": "Armlochbeleg",
    "neck band": "Halsbündchen",
    "neck binding": "Halseinfassung",
    "armhole binding": "Armlocheinfassung",
    "button stand": "Übertritt",
    "stand end": "Übertritt unten",
    "inner edge": "Innenkante",
    "fold line": "Umbruch",
    "pocket bag": "Taschenbeutel",
    "pocket opening": "Tascheneingriff",
    "of the lining": "des Futters",
    "of the waistband": "des Bundes",
    "lining to": "Futter an",
    "left end": "linkes Ende",
    "right end": "rechtes Ende",
    "front": "Vorderteil",
    "back": "Rückenteil",
    "bodice": "Oberteil",
    "skirt": "Rock",
    "sleeve": "Ärmel",
    "shoulder": "Schulter",
    "side": "Seite",
    "armhole": "Armloch",
    "neck": "Hals",
    "waist": "Taille",
    "hip": "Hüfte",
    "abdomen": "Bauch",
    "bust": "Brust",
    "underbust": "Unterbrust",
    "chest": "Brustkorb",
    "thigh": "Oberschenkel",
    "knee": "Knie",
    "calf": "Wade",
    "ankle": "Knöchel",
    "biceps": "Oberarm",
    "elbow": "Ellbogen",
    "forearm": "Unterarm",
    "wrist": "Handgelenk",
    "underarm": "Unterarmnaht",
    "overarm": "Oberarmlinie",
    "inseam": "Innenbeinnaht",
    "outseam": "Außenbeinnaht",
    "crotch": "Schritt",
    "crease": "Bügelfalte",
    "princess": "Prinzesslinie",
    "yoke": "Passe",
    "waistband": "Bund",
    "facing": "Beleg",
    "band": "Bündchen",
    "binding": "Einfassung",
    "lining": "Futter",
    "interfacing": "Einlage",
    "pocket": "Tasche",
    "dart": "Abnäher",
    "ends": "Enden",
    "upper": "oben",
    "lower": "unten",
    "overlap": "Untertritt",
    "rim": "Rand",
    "opening": "Eingriff",
    "slit": "Schlitz",
    "vent": "Gehschlitz",
    "keyhole": "Tropfenausschnitt",
    "buttonhole": "Knopfloch",
    "left": "links",
    "right": "rechts",
}

#: Whole phrases, with places in braces for what is filled in.
PHRASES = {
    "size {size}": "Größe {size}",
    "sizes {sizes}": "Größen {sizes}",
    "made to measure": "nach Maß",
    "Cut {count}": "{count}x zuschneiden",
    "Cut {count} on fold": "{count}x im Stoffbruch zuschneiden",
    "Cut {count}, {mirrored} mirrored": "{count}x zuschneiden, davon {mirrored}x gespiegelt",
    "Includes {allowances}": "Enthält {allowances}",
    "seam {widths}": "Naht {widths}",
    "hem {widths}": "Saum {widths}",
    "seams {width}": "Nähte {width}",
    "hems {width}": "Säume {width}",
    "mirrored": "gespiegelt",
    "PLACE ON FOLD": "IM STOFFBRUCH",
    "Print at 100 % (actual size). Do not fit to the page.": (
        "In Originalgröße (100 %) drucken, nicht an die Seite anpassen."
    ),
    "Paper: {paper}. Measure both squares before you cut anything.": (
        "Papier: {paper}. Vor dem Zuschneiden beide Quadrate nachmessen."
    ),
    "1 inch": "1 Zoll",
    "cutting line": "Schnittlinie",
    "sewing line": "Nahtlinie",
    "hem line": "Saumlinie",
    "fold of the cloth": "Stoffbruch",
    "dart leg": "Abnäherschenkel",
    "fold of a dart": "Abnähermitte",
    "level or line of the body": "Körperlinie",
    "grain: along the warp": "Fadenlauf: in Kettrichtung",
    "point to mark: dart, button, pocket": "Punkt markieren: Abnäher, Knopf, Tasche",
    "notch: clip; letter of its seam": "Knips; Buchstabe der Naht",
    "Cut each sheet along its left and upper line. Lay it on the lines of its left and upper neighbours, so that": (
        "Jedes Blatt an der linken und oberen Linie abschneiden, auf die Linien der Nachbarblätter links und oben legen,"
    ),
    "the half diamonds meet, and glue. {sheets} sheets; empty ones are left out.": (
        "sodass die Rauten sich treffen, und kleben. {sheets} Blätter; leere fehlen."
    ),
    "print this page first and measure both squares": "diese Seite zuerst drucken und beide Quadrate messen",
    "cutting and sewing": "Zuschneiden und Nähen",
    "sheet {name}": "Blatt {name}",
    "{paper}, print at 100 %": "{paper}, mit 100 % drucken",
    "Cut": "Zuschneiden",
    "Allowances are included: {allowances}. Lay every grain arrow along the selvedge.": (
        "Zugaben sind enthalten: {allowances}. Jeden Fadenlaufpfeil entlang der Webkante legen."
    ),
    "From each cloth": "Aus jedem Stoff",
    "{title} {count}": "{title} {count}x",
    "{title} {count} on fold": "{title} {count}x im Bruch",
    "Cloth needed": "Stoffverbrauch",
    "{width} wide": "{width} breit",
    "too narrow": "zu schmal",
    "Pieces laid flat on one layer, both ways up the grain. Take more for nap, prints and shrinkage.": (
        "Einlagig gelegt, Teile in beiden Richtungen des Fadenlaufs. Für Strich und Muster mehr nehmen."
    ),
    "Seams": "Nähte",
    "seam": "Naht",
    "length": "Länge",
    "sewn to": "genäht an",
    "Sewing order": "Nähreihenfolge",
    "Notes": "Hinweise",
    "Right sides together. Letters stand beside the notches; notches with the same letter meet.": (
        "Rechts auf rechts. Buchstaben stehen neben den Knipsen; Knipse mit gleichem Buchstaben treffen sich."
    ),
    "Join the panels": "Teilungsnähte schließen",
    "Sew the shoulders": "Schulternähte schließen",
    "Sew the inner leg seams": "Innenbeinnähte schließen",
    "Sew the side seams": "Seitennähte schließen",
    "Sew the sleeve seams": "Ärmelnähte schließen",
    "Sew the crotch seam": "Schrittnaht schließen",
    "Join at the waist": "In der Taille zusammennähen",
    "Set the sleeves in": "Ärmel einsetzen",
    "Attach the collar": "Kragen annähen",
    "Join the linings": "Futter zusammennähen",
    "Join facings, bands and bindings, and sew them to their edges": (
        "Belege, Bündchen und Einfassungen schließen und an ihre Kanten nähen"
    ),
    "Sew": "Nähen",
    "{what}, notch to notch: {seams}.": "{what}, Knips auf Knips: {seams}.",
    "Sew the darts, from the edge to the tip, and press them: {darts}.": (
        "Abnäher von der Kante zur Spitze nähen und bügeln: {darts}."
    ),
    "Fold the pleats and sew them as far as they are marked; they hang open below: {pleats}.": (
        "Falten legen und so weit nähen, wie sie eingezeichnet sind; darunter fallen sie offen: {pleats}."
    ),
    "Finish the raw edges with a facing, a band or binding: {edges}.": (
        "Offene Kanten mit Beleg, Bündchen oder Einfassung versäubern: {edges}."
    ),
    "Turn in the patch pockets and sew them to their marks: {pockets}.": (
        "Aufgesetzte Taschen umbügeln und auf ihre Markierungen nähen: {pockets}."
    ),
    "Turn up and sew the hems: {edges}.": "Säume umschlagen und nähen: {edges}.",
    "Work the buttonholes on the right half, and sew {count} buttons to the left one: {title}.": (
        "Knopflöcher in die rechte Hälfte arbeiten und {count} Knöpfe an die linke nähen: {title}."
    ),
    "{seam}: {first} to {second}": "{seam}: {first} an {second}",
    "{seam} of the {first}": "{seam}, {first}",
    ", gather the {piece}": ", {piece} einkräuseln",
    ", ease in the {piece}": ", {piece} einhalten",
    "and": "und",
    "piece": "Teil",
}
