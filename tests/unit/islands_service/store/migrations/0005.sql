BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0005');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('c664ef037fdb4b86bb44db6cc8235de2','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('1d7e043727734d5d9724ee603937ec19','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79536215923101902009e+09,'cancel-job','alice','7182e7f744b64c6fa2eb602d43829e5a','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79536215923898506167e+09,'delete-job','alice','7182e7f744b64c6fa2eb602d43829e5a',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, source TEXT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79536215908199548721e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv');
CREATE TABLE deliveries (
	id VARCHAR(32) NOT NULL, 
	webhook_id VARCHAR(32) NOT NULL, 
	event VARCHAR(32) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	body TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at FLOAT, 
	attempted FLOAT, 
	delivered FLOAT, 
	status INTEGER, 
	error TEXT, 
	CONSTRAINT pk_deliveries PRIMARY KEY (id), 
	CONSTRAINT fk_deliveries_webhook_id FOREIGN KEY(webhook_id) REFERENCES webhooks (id) ON DELETE CASCADE
);
INSERT INTO "deliveries" VALUES('d23feb9128514a588a2c9b4f5b1a5ac9','07be9a0ac550484bb64da994467e1240','job.succeeded','c664ef037fdb4b86bb44db6cc8235de2','{"type":"job.succeeded","timestamp":"2026-11-22T15:42:39.149+00:00","data":{"job":"c664ef037fdb4b86bb44db6cc8235de2","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/c664ef037fdb4b86bb44db6cc8235de2","result":"/v1/jobs/c664ef037fdb4b86bb44db6cc8235de2/result","report":"/v1/jobs/c664ef037fdb4b86bb44db6cc8235de2/report"}}}',1.79536215914998960492e+09,0,1.79536215914998960492e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('c664ef037fdb4b86bb44db6cc8235de2',1,'queued','{}',1.79536215910400295259e+09);
INSERT INTO "events" VALUES('c664ef037fdb4b86bb44db6cc8235de2',2,'running','{"attempt": 1}',1.79536215912399888037e+09);
INSERT INTO "events" VALUES('c664ef037fdb4b86bb44db6cc8235de2',3,'progress','{"generation": 3}',1.79536215913200521468e+09);
INSERT INTO "events" VALUES('c664ef037fdb4b86bb44db6cc8235de2',4,'succeeded','{"best": 0.5}',1.79536215914998960492e+09);
INSERT INTO "events" VALUES('1d7e043727734d5d9724ee603937ec19',1,'queued','{}',1.79536215917698597902e+09);
INSERT INTO "events" VALUES('1d7e043727734d5d9724ee603937ec19',2,'running','{"attempt": 1}',1.79536215918499231333e+09);
INSERT INTO "events" VALUES('1d7e043727734d5d9724ee603937ec19',3,'progress','{"generation": 3}',1.79536215919299864765e+09);
INSERT INTO "events" VALUES('1d7e043727734d5d9724ee603937ec19',4,'failed','{"type": "broken", "detail": "it broke"}',1.79536215920201086991e+09);
INSERT INTO "events" VALUES('62881fbc41c048dca8321b6347019e03',1,'queued','{}',1.79536215921500635146e+09);
INSERT INTO "events" VALUES('62881fbc41c048dca8321b6347019e03',2,'cancelled','{}',1.79536215922301268578e+09);
INSERT INTO "events" VALUES('3eebfe6548454c598a53c1cd4453d930',1,'queued','{}',1.79536215924497985843e+09);
INSERT INTO "events" VALUES('3eebfe6548454c598a53c1cd4453d930',2,'running','{"attempt": 1}',1.79536215925000905988e+09);
INSERT INTO "events" VALUES('3eebfe6548454c598a53c1cd4453d930',3,'progress','{"generation": 5}',1.79536215925801539419e+09);
INSERT INTO "events" VALUES('4a2e70b9e56047cc85bf69c287171dd8',1,'queued','{}',1.795362159263004303e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('c664ef037fdb4b86bb44db6cc8235de2','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79536575912399888037e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79536215910400295259e+09,1.79536215914998960492e+09,1.79536215912399888037e+09,1.79536215914998960492e+09,'0.1.0','0.1.0','0.1.0',0.0,'');
INSERT INTO "jobs" VALUES('1d7e043727734d5d9724ee603937ec19','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79536575918499231342e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79536215917698597902e+09,1.79536215920201086991e+09,1.79536215918499231333e+09,1.79536215920201086991e+09,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('62881fbc41c048dca8321b6347019e03','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79536215921500635146e+09,1.79536215922301268578e+09,NULL,1.79536215922301268578e+09,'0.1.0',NULL,NULL,0.0,'');
INSERT INTO "jobs" VALUES('3eebfe6548454c598a53c1cd4453d930','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'9afe8b393ff546139b82e4e944bf769c',1,1.79536215825000905988e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79536215924497985843e+09,1.79536215925801539419e+09,1.79536215925000905988e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('4a2e70b9e56047cc85bf69c287171dd8','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.795362159263004303e+09,1.795362159263004303e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'');
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('6db8691abd9ddc3e','alice','revoked','93b8882a008dcc1f488861ae79e51ed653ae54249a550277f3c9112a0ee386b7','["read", "write"]',1.79536215906598281858e+09,1.79536575906598281854e+09,1.7953621590770065784e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('c664ef037fdb4b86bb44db6cc8235de2',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('c664ef037fdb4b86bb44db6cc8235de2',2,'{"fitness": 0.7}','second');
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('c664ef037fdb4b86bb44db6cc8235de2',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('1d7e043727734d5d9724ee603937ec19',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('3eebfe6548454c598a53c1cd4453d930',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('c664ef037fdb4b86bb44db6cc8235de2','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','7182e7f744b64c6fa2eb602d43829e5a','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79536215923001313213e+09);
CREATE TABLE webhooks (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	url TEXT NOT NULL, 
	events TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	created FLOAT NOT NULL, 
	busy_until FLOAT DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_webhooks PRIMARY KEY (id)
);
INSERT INTO "webhooks" VALUES('07be9a0ac550484bb64da994467e1240','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_Y5CInKJz8jFUSYVcyNP6JGHLRSB39hUbXUWpJFBE72M=',1.79536215909398508064e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
COMMIT;
