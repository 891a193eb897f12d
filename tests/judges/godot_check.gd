# godot3-server --path PROJECT -s godot_check.gd: what Godot made of res://person.glb, in PROJECT/found.json and .bin.
# found.json: { bones: {name: parent}, triangles, images, clips: {name: seconds}, morphs }
# found.bin: float32 of the rest [W 3], then of each pose of poses.json [P J 4 4], as Godot's skeleton and skin bend it.
extends SceneTree

var skeleton
var mesh
var binds = []  # for each bone that the mesh names: [bone of the skeleton, inverse bind]


func _init():
	var scene = load("res://person.glb").instance()
	get_root().add_child(scene)  # a skeleton outside the tree does not move
	find_parts(scene)
	var skin = mesh.skin
	for i in skin.get_bind_count():
		var bone = skin.get_bind_bone(i)
		if bone < 0:
			bone = skeleton.find_bone(skin.get_bind_name(i))
		binds.append([bone, skin.get_bind_pose(i)])
	write_json("res://found.json", describe(scene))
	var out = File.new()
	out.open("res://found.bin", File.WRITE)
	store(out)
	for transforms in read_json("res://poses.json")["T_posed_rest"]:
		pose(transforms)
		store(out)
	out.close()
	quit()


func find_parts(node):
	if node is Skeleton:
		skeleton = node
	if node is MeshInstance:
		mesh = node
	for child in node.get_children():
		find_parts(child)


func describe(scene):
	var bones = {}
	for i in skeleton.get_bone_count():
		var parent = skeleton.get_bone_parent(i)
		bones[skeleton.get_bone_name(i)] = skeleton.get_bone_name(parent) if parent >= 0 else null
	var clips = {}
	for node in scene.get_children():
		if node is AnimationPlayer:
			for name in node.get_animation_list():
				clips[name] = node.get_animation(name).length
	var morphs = []
	for i in mesh.mesh.get_blend_shape_count():
		morphs.append(mesh.mesh.get_blend_shape_name(i))
	var picture = mesh.mesh.surface_get_material(0).albedo_texture
	return {
		"bones": bones,
		"triangles": len(arrays()[Mesh.ARRAY_INDEX]) / 3,
		"images": [[picture.get_width(), picture.get_height()]],
		"clips": clips,
		"morphs": morphs,
	}


func arrays():
	return mesh.mesh.surface_get_arrays(0)


# Put every bone where its posed <- rest transform takes it, parents first; Godot's pose is relative to the rest.
func pose(transforms):
	var worlds = []
	for i in skeleton.get_bone_count():
		skeleton.set_bone_pose(i, Transform.IDENTITY)
	var rests = []
	for i in skeleton.get_bone_count():
		rests.append(skeleton.get_bone_global_pose(i))
	for i in skeleton.get_bone_count():
		worlds.append(read_transform(transforms[skeleton.get_bone_name(i)]) * rests[i])
	for i in skeleton.get_bone_count():
		var parent = skeleton.get_bone_parent(i)
		var outer = worlds[parent] if parent >= 0 else Transform.IDENTITY
		skeleton.set_bone_pose(i, (outer * skeleton.get_bone_rest(i)).affine_inverse() * worlds[i])


func read_transform(rows):
	var basis = Basis(
		Vector3(rows[0][0], rows[1][0], rows[2][0]),
		Vector3(rows[0][1], rows[1][1], rows[2][1]),
		Vector3(rows[0][2], rows[1][2], rows[2][2])
	)
	return Transform(basis, Vector3(rows[0][3], rows[1][3], rows[2][3]))


# The vertices under linear blending of Godot's own bone transforms, binds and weights.
func store(out):
	var found = arrays()
	var vertices = found[Mesh.ARRAY_VERTEX]
	var bones = found[Mesh.ARRAY_BONES]
	var weights = found[Mesh.ARRAY_WEIGHTS]
	var moves = []
	for bind in binds:
		moves.append(skeleton.get_bone_global_pose(bind[0]) * bind[1])
	for i in len(vertices):
		var point = Vector3()
		for k in range(4 * i, 4 * i + 4):
			point += weights[k] * moves[int(bones[k])].xform(vertices[i])
		out.store_float(point.x)
		out.store_float(point.y)
		out.store_float(point.z)


func read_json(path):
	var file = File.new()
	file.open(path, File.READ)
	var found = JSON.parse(file.get_as_text()).result
	file.close()
	return found


func write_json(path, value):
	var file = File.new()
	file.open(path, File.WRITE)
	file.store_string(to_json(value))
	file.close()
