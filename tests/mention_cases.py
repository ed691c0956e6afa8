"""Texts with and without a mention of a hazard, as a person reading the failure page would judge them.

Decided before the rule was written: a word for the kind at large names the hazard too ("animal" for a
deer, "vehicle" for a car, "person" for a pedestrian, "debris" for a box); a sibling does not (a truck is
no car), nor does a part (a car door is no car), nor the own vehicle, nor what is said not to be there,
nor a word that fits anything ("object", "hazard"). The rule was adjusted on `CHOOSING` only.
"""

from typing import NamedTuple


class Case(NamedTuple):
    """A text, the truth's label and description, and whether the text mentions that hazard."""

    text: str
    label: str
    description: str
    mentioned: bool


_DEER = ("Deer", "A deer runs across the road from the left")
_CAT = ("Cat", "A cat crossing the road")
_DOG = ("Dog", "A brown dog trots along the edge of the lane")
_CAR = ("Car", "An oncoming black car drifts into our lane")
_DOOR = ("Car door", "The driver of a parked taxi opens the door into our path")
_MOTORCYCLE = ("Motorcycle", "An oncoming motorcyclist appears from behind a white car in the bend")
_PEDESTRIAN = ("Pedestrian", "A pedestrian steps out between parked cars")
_CYCLIST = ("Cyclist", "A cyclist swerves around a puddle")
_BOX = ("Cardboard box", "A large cardboard box lies in the middle of the lane")
_TIRE = ("Tire", "A loose tire rolls across the motorway")
_TREE = ("Fallen tree", "A tree has fallen across both lanes")
_GLARE = ("Sun glare", "The low sun fills the windscreen with haze and hides the road ahead")
_VAN = ("Van", "A white van pulls out without signalling")
_TRUCK = ("Truck", "A truck loses part of its load")
_BIRDS = ("Birds", "A flock of geese walks over the street")
_DEBRIS = ("Debris", "A small piece of debris lies on the exit ramp")
_CHILD = ("Child", "A child on a scooter rolls off the pavement")
_ROCKS = ("Rocks", "Rocks from a landslide cover the right lane")
_CONE = ("Traffic cone", "An orange traffic cone stands in the lane")
_HORSE = ("Horse", "Two horses without a rider gallop towards us")
_KANGAROO = ("Kangaroo", "A kangaroo hops over the highway at dusk")
_MATTRESS = ("Mattress", "A mattress falls off a pickup truck in front of us")
_SUV = ("SUV", "A dark SUV passes close alongside us on the right")
_SMOKE = ("Smoke", "Thick smoke from a burning field drifts over the road")
_POTHOLE = ("Pothole", "A deep pothole opens in front of the left wheel")
_BALL = ("", "A red ball bounces into the street")
_POLICE = ("Police officer", "A police officer waves us through the junction")
_FLOOD = ("Flooded road", "Water covers the whole road under the bridge")
_FOG = ("Fog", "Dense fog hides the cars ahead")
_BARRIER = ("Road barrier", "A barrier closes the lane without warning")
_CART = ("Shopping cart", "An abandoned shopping cart rolls into the road")
_BIN = ("Trash bin", "A trash bin lies in the lane after the storm")
_FIRE_ENGINE = ("Fire truck", "A fire truck crosses the junction at a red light")
_LIGHT = ("Traffic light", "The traffic light is out of order")
_ICE = ("Ice", "Black ice covers the bend")
_EXCAVATOR = ("Excavator", "An excavator swings its arm over the lane")
_STROLLER = ("Stroller", "An empty stroller rolls towards the kerb")
_CRASH = ("Crash", "Two cars have collided at the junction")
_CABLE = ("Cable", "A cable hangs low over the road")
_GATE = ("Gate", "A gate swings open onto the lane")
_SKIER = ("Roller skier", "A roller skier trains on the country road")
_AVALANCHE = ("Mudslide", "Mud from the slope pours over the road")
_PLANE = ("Plane", "A small plane lands on the highway")
_LAMP = ("Street lamp", "A street lamp has tipped over the lane")
_PARCEL = ("Package", "A package falls from a cargo bike")
_LONG = "The road is straight and the weather is clear, with trees on both sides. " * 200

CHOOSING = (
    Case("An animal is crossing the road ahead.", *_DEER, True),
    Case("deer crossing road", *_DEER, True),
    Case("The road is clear, with trees on both sides.", *_DEER, False),
    Case("There are no animals on the road.", *_DEER, False),
    Case("No hazards or anomalies.", *_DEER, False),
    Case("There is no cat.", *_CAT, False),
    Case("a kitten on the road", *_CAT, True),
    Case("No pedestrians, but a cat crosses from the right.", *_CAT, True),
    Case("A squirrel runs across the road.", *_CAT, False),
    Case("A large object is blocking the lane.", *_CAT, False),
    Case("The road is free of dogs and other animals.", *_DOG, False),
    Case("A puppy is following the cyclist.", *_DOG, True),
    Case("A stray dog, brown, near the lane marking", *_DOG, True),
    Case("Several vehicles are driving ahead.", *_CAR, True),
    Case("car, traffic light, road", *_CAR, True),
    Case("A pedestrian crosses in front of the vehicle.", *_CAR, False),
    Case("The car door of a parked truck is open.", *_CAR, False),
    Case("An automobile comes towards the camera.", *_CAR, True),
    Case("A car is ahead of us.", *_DOOR, False),
    Case("The door of the taxi opens suddenly.", *_DOOR, True),
    Case("Someone opens a car door.", *_DOOR, True),
    Case("A motorcycle is moving away on the left.", *_MOTORCYCLE, True),
    Case("A white car goes round the bend.", *_MOTORCYCLE, False),
    Case("A bicycle leans on a wall.", *_MOTORCYCLE, False),
    Case("People are walking across the street.", *_PEDESTRIAN, True),
    Case("A man with an umbrella steps off the kerb.", *_PEDESTRIAN, True),
    Case("pedestrian crossing road", *_PEDESTRIAN, True),
    Case("A cyclist passes between parked cars.", *_PEDESTRIAN, False),
    Case("Pedestrians: none. Vehicles: 3.", *_PEDESTRIAN, False),
    Case("I do not see any pedestrians or animals.", *_PEDESTRIAN, False),
    Case("A pedestrian is not looking at the traffic.", *_PEDESTRIAN, True),
    Case("A bicycle swerves in front of us.", *_CYCLIST, True),
    Case("A pedestrian swerves around a puddle.", *_CYCLIST, False),
    Case("Debris lies in the lane.", *_BOX, True),
    Case("boxes", *_BOX, True),
    Case("A plastic bag blows over the lane.", *_BOX, False),
    Case("The middle lane is empty.", *_BOX, False),
    Case("A wheel rolls across the road.", *_TIRE, True),
    Case("Tyres on the roadway", *_TIRE, True),
    Case("A fallen tree blocks the road.", *_TREE, True),
    Case("The sun is low and blinds the driver.", *_GLARE, True),
    Case("Bright glare on the windscreen", *_GLARE, True),
    Case("A white building and a red light ahead.", *_GLARE, False),
    Case("A white car pulls out.", *_VAN, False),
    Case("Three white pedestrian signs", *_VAN, False),
    Case("A lorry drives ahead.", *_TRUCK, True),
    Case("A pickup truck is parked.", *_TRUCK, True),
    Case("geese on the road", *_BIRDS, True),
    Case("A piece of trash on the asphalt", *_DEBRIS, True),
    Case("The ramp is free of debris.", *_DEBRIS, False),
    Case("A kid rides along the pavement.", *_CHILD, True),
    Case("Boulders and stones on the lane", *_ROCKS, True),
    Case("A rock band poster on the wall", *_ROCKS, False),
    Case("", *_DEER, False),
    Case(_LONG, *_DEER, False),
    Case("A deer is here. " + _LONG, *_DEER, True),
    Case("<script>alert('deer')</script>", *_CAT, False),
    Case("\u202e\x00\ud800 ☃ 12345 !!!", *_CAT, False),
    Case("A red car waits in the street.", *_BALL, False),
    Case("A policeman stands at the junction.", *_POLICE, True),
    Case("Officers direct the traffic.", *_POLICE, True),
    Case("The street is under water.", *_FLOOD, True),
    Case("A flood covers the lane.", *_FLOOD, True),
    Case("There is mist over the fields.", *_FOG, True),
    Case("A foggy morning with haze", *_FOG, True),
    Case("Concrete barricades close the lane.", *_BARRIER, True),
    Case("A sign warns of the lane ahead.", *_BARRIER, False),
    Case("A shopping trolley is in the road.", *_CART, True),
    Case("A trash can has tipped over.", *_BIN, True),
    Case("Garbage bins stand in a row.", *_BIN, True),
    Case("A fire engine has its lights on.", *_FIRE_ENGINE, True),
    Case("A stoplight is visible.", *_LIGHT, True),
    Case("A street lamp is visible.", *_LIGHT, False),
    Case("Snow lies on the fields.", *_ICE, False),
    Case("icy patches, frost", *_ICE, False),
    Case("A bulldozer is parked.", *_EXCAVATOR, False),
    Case("A digger works in the lane.", *_EXCAVATOR, True),
    Case("A pony runs along the verge.", *_HORSE, True),
    Case("An unidentified animal at dusk", *_KANGAROO, True),
    Case("A football rolls onto the street.", *_BALL, True),
    Case("1. A deer near the guard rail 2. A parked van", *_DEER, True),
    Case("Neither deer nor people can be seen.", *_DEER, False),
    Case("No sign of any animal.", *_DEER, False),
    Case("A cathedral stands beside the road.", *_CAT, False),
    Case("CAT ON ROAD", *_CAT, True),
    Case("The vehicle is not hitting the cat.", *_CAT, True),
    Case("Animals: none visible", *_DOG, False),
    Case("A black saloon car drifts over the line.", *_CAR, True),
    Case("cars/trucks on the road", *_CAR, True),
    Case("Our car is approaching a junction.", *_CAR, False),
    Case("A parked vehicle with hazard lights", *_DOOR, False),
    Case("a biker in the curve", *_MOTORCYCLE, True),
    Case("There aren't any people around.", *_PEDESTRIAN, False),
    Case("bicyclist in the lane", *_CYCLIST, True),
    Case("An empty carton is blowing over the road.", *_BOX, True),
    Case("A bottle lies in the middle of the lane.", *_BOX, False),
    Case("A large trunk lies across the road.", *_TREE, True),
    Case("Sunlight reflects from the wet road.", *_GLARE, True),
    Case("A minivan comes out of a drive.", *_VAN, True),
    Case("The semi-trailer truck loses boxes.", *_TRUCK, True),
    Case("A rockfall covers the right lane.", *_ROCKS, True),
    Case("A baby carriage rolls down the hill.", *_STROLLER, True),
    Case("A pram stands alone.", *_STROLLER, True),
    Case("A collision happened at the junction.", *_CRASH, True),
    Case("An accident blocks the junction.", *_CRASH, True),
    Case("A wire dangles above the road.", *_CABLE, True),
    Case("A fence runs along the lane.", *_GATE, False),
    Case("A skier crosses the road.", *_SKIER, True),
    Case("A landslide has buried the road.", *_AVALANCHE, True),
    Case("An airplane is on the highway.", *_PLANE, True),
    Case("An aircraft approaches.", *_PLANE, True),
    Case("A lamp post leans over the lane.", *_LAMP, True),
    Case("A parcel lies in the road.", *_PARCEL, True),
    Case("A letter box on the wall", *_PARCEL, False),
)

_SHEEP = ("Sheep", "Three sheep trot along the mountain road")
_BEAR = ("Bear", "A bear climbs over the guard rail")
_WOMAN = ("Pedestrian", "An elderly woman crosses slowly with a walking stick")
_SKATER = ("Skateboarder", "A skateboarder rolls down the hill in our lane")
_BUS = ("Bus", "A school bus stops suddenly in front of us")
_TRAILER = ("Trailer", "A trailer has come loose from the car in front")
_HELMET = ("Helmet", "A helmet bounces over the asphalt")
_LADDER = ("Ladder", "An aluminium ladder lies across two lanes")
_PIPE = ("Pipes", "Steel pipes slide off a lorry")
_BRANCH = ("Branch", "A thick branch hangs over the right lane")
_GRAVEL = ("Gravel", "Loose gravel lies in the bend after the rain")
_RAIN = ("Heavy rain", "A downpour takes away all sight within seconds")
_FIRE = ("Burning car", "A car is on fire on the hard shoulder")
_BICYCLE = ("Bicycle", "A boy on a bicycle comes out of a side street")
_SCOOTER = ("Scooter", "A scooter overtakes between the lanes")
_TRACTOR = ("Tractor", "A slow tractor turns onto the main road")
_WRONG_WAY = ("Wrong-way driver", "A silver car comes towards us on our side of the motorway")
_SUITCASE = ("Suitcase", "A suitcase has fallen from a roof rack")
_GULL = ("Seagull", "A seagull flies into the windscreen")
_POST = ("Fallen post", "An orange marker post lies flat on the ground at the right edge of the road")
_SHADOW = ("Overpass shadow", "The road suddenly goes dark as we pass under an overpass")
_SIGN = ("Road sign", "A road sign has been blown into the lane")
_MONKEY = ("Animal", "A monkey sits on the centre line")

HELD_OUT = (
    Case("Sheep are walking on the road.", *_SHEEP, True),
    Case("Three white cars on the mountain road", *_SHEEP, False),
    Case("A herd of animals blocks both lanes.", *_SHEEP, True),
    Case("A goat stands near the road.", *_SHEEP, False),
    Case("There are no people, animals, or debris in the image.", *_SHEEP, False),
    Case("A lamb follows its mother.", *_SHEEP, True),
    Case("A large brown bear is next to the guard rail.", *_BEAR, True),
    Case("A guard rail runs along the right side.", *_BEAR, False),
    Case("I cannot see any bear.", *_BEAR, False),
    Case("A grizzly at the roadside", *_BEAR, True),
    Case("A brown dog is next to the guard rail.", *_BEAR, False),
    Case("An old lady is crossing the street.", *_WOMAN, True),
    Case("1. Pedestrian: a woman with a stick. 2. Car: parked.", *_WOMAN, True),
    Case("Two people are on the pavement.", *_WOMAN, True),
    Case("The crosswalk is empty.", *_WOMAN, False),
    Case("No pedestrians are visible on the crosswalk.", *_WOMAN, False),
    Case("A cyclist waits at the crossing.", *_WOMAN, False),
    Case("The street is free of pedestrians and cyclists.", *_WOMAN, False),
    Case("Pedestrians crossing", *_WOMAN, True),
    Case("A boy on a skateboard comes down the hill.", *_SKATER, True),
    Case("skateboarders", *_SKATER, True),
    Case("A person rolls down the lane.", *_SKATER, True),
    Case("A skate park is on the left.", *_SKATER, False),
    Case("A yellow school bus has stopped.", *_BUS, True),
    Case("Buses and trucks wait in line.", *_BUS, True),
    Case("A school is on the right.", *_BUS, False),
    Case("The bus stop is empty.", *_BUS, False),
    Case("A large vehicle brakes.", *_BUS, True),
    Case("A coach is at the kerb.", *_BUS, True),
    Case("A yellow taxi has stopped in front of us.", *_BUS, False),
    Case("A loose trailer swerves across the lanes.", *_TRAILER, True),
    Case("The car in front has a roof box.", *_TRAILER, False),
    Case("There is a caravan on the road.", *_TRAILER, False),
    Case("A motorcycle helmet is on the ground.", *_HELMET, True),
    Case("A motorcyclist is ahead.", *_HELMET, False),
    Case("An unknown object bounces over the asphalt.", *_HELMET, False),
    Case("A ladder has fallen from a van.", *_LADDER, True),
    Case("Some kind of debris lies across the lanes.", *_LADDER, True),
    Case("A mattress and a chair lie across two lanes.", *_LADDER, False),
    Case("The lanes are free; there is no ladder.", *_LADDER, False),
    Case("Metal tubes are falling from the lorry.", *_PIPE, True),
    Case("A pipe is sticking out of the load.", *_PIPE, True),
    Case("A lorry with a long load", *_PIPE, False),
    Case("Fallen branches and leaves cover the lane.", *_BRANCH, True),
    Case("A bank branch is on the corner.", *_BRANCH, True),
    Case("A dead limb sticks out over the lane.", *_BRANCH, True),
    Case("The right lane is narrow.", *_BRANCH, False),
    Case("There is some gravel on the road.", *_GRAVEL, True),
    Case("Small stones and grit lie in the curve.", *_GRAVEL, True),
    Case("The road is wet after the rain.", *_GRAVEL, False),
    Case("It is raining heavily, and rain covers the windscreen.", *_RAIN, True),
    Case("A thunderstorm with a downpour", *_RAIN, True),
    Case("The sun shines on dry asphalt.", *_RAIN, False),
    Case("There is heavy traffic.", *_RAIN, False),
    Case("A vehicle burns on the right.", *_FIRE, True),
    Case("Flames come out of the bonnet of a car.", *_FIRE, True),
    Case("A burning truck blocks the lane.", *_FIRE, False),
    Case("A parked bicycle leans on the wall.", *_BICYCLE, True),
    Case("A bike comes from the side street.", *_BICYCLE, True),
    Case("Cyclists ride in a group.", *_BICYCLE, True),
    Case("A motorcycle comes from the side street.", *_BICYCLE, False),
    Case("Nobody rides a bicycle; the street is calm and without traffic.", *_BICYCLE, False),
    Case("A moped drives between two cars.", *_SCOOTER, True),
    Case("Two cars drive side by side.", *_SCOOTER, False),
    Case("An electric scooter lies on the pavement.", *_SCOOTER, True),
    Case("A green tractor pulls a plough.", *_TRACTOR, True),
    Case("A farm vehicle is ahead.", *_TRACTOR, True),
    Case("A field with a farmhouse on the left", *_TRACTOR, False),
    Case("A red truck turns onto the main road.", *_TRACTOR, False),
    Case("A car comes straight at us in our lane.", *_WRONG_WAY, True),
    Case("A silver bus overtakes us.", *_WRONG_WAY, False),
    Case("Our vehicle keeps to its lane.", *_WRONG_WAY, False),
    Case("A man walks in front of the car.", *_WRONG_WAY, False),
    Case("Luggage lies in the road.", *_SUITCASE, True),
    Case("A bag or suitcase on the lane", *_SUITCASE, True),
    Case("A car with a roof rack is ahead.", *_SUITCASE, False),
    Case("A traveller waits at the bus stop.", *_SUITCASE, False),
    Case("A white bird hits the windscreen.", *_GULL, True),
    Case("Gulls circle over the harbour.", *_GULL, True),
    Case("A crow sits on the fence.", *_GULL, False),
    Case("There is a crack in the windscreen.", *_GULL, False),
    Case("An orange post is lying next to the road.", *_POST, True),
    Case("Orange barrels stand at the edge of the road.", *_POST, False),
    Case("A knocked-over pole on the right", *_POST, True),
    Case("The road is straight and the ground is dry.", *_POST, False),
    Case("A dark shadow lies over the road.", *_SHADOW, True),
    Case("The road goes under a bridge.", *_SHADOW, False),
    Case("The road is clear.", *_SHADOW, False),
    Case("A sign lies on the ground.", *_SIGN, True),
    Case("There is no sign of any danger.", *_SIGN, False),
    Case("Traffic signs are blown over.", *_SIGN, True),
    Case("A monkey jumps from a tree.", *_MONKEY, True),
    Case("A wild animal is ahead.", *_MONKEY, True),
    Case("An ape sits on the centre line.", *_MONKEY, True),
    Case("A dog runs over the road.", *_MONKEY, True),
    Case("The centre line is dashed.", *_MONKEY, False),
    Case("", *_BUS, False),
    Case("   \n\t ", *_SHEEP, False),
    Case(_LONG + _LONG, *_BEAR, False),
    Case("A bear! " + _LONG, *_BEAR, True),
    Case("'; DROP TABLE bear; --", *_SHEEP, False),
    Case("{{ bear }} ${bear} %s <img src=x onerror=alert(1)>", *_SHEEP, False),
    Case("\u202egnissorc reed\u202c \U0001f98c", *_DEER, False),
    Case("A" * 5_000, *_CAR, False),
)
